#include "server/dds/replicas/replica_link.h"

#include <pthread.h>

#include <algorithm>

#include "server/dds/codec.h"

namespace trammel {
namespace {

constexpr std::chrono::milliseconds kStep{250};        // at the longest; news wake it
constexpr std::chrono::milliseconds kDivergent{3000};  // of two that are in step, longer than any copy takes
constexpr std::chrono::seconds kModelComes{10};        // after it was told of
// That may wait to be stored: the writer sends the others again. One is taken however large it is.
constexpr std::size_t kCopiesAtOnce = 64;
constexpr std::size_t kCopiedBytesAtOnce = 64'000'000;

StoredBatch batch_in(const wire::BatchCopy& copy) {
  StoredBatch batch;
  batch.cell = copy.cell().to_string();
  batch.id = copy.batch_id();
  batch.csv = copy.csv();
  batch.hash = copy.hash();
  batch.quarantine = copy.quarantine();
  batch.discarded = copy.discarded();
  batch.learned = copy.learned();
  batch.outcome = copy.outcome();
  batch.accepted_at = copy.accepted_at_unix_s();
  return batch;
}

template <typename State>
Result<wire::dds::DataWriter*> make_writer(wire::dds::DomainParticipant& participant, wire::dds::Publisher& publisher,
                                           const wire::dds::DataWriterQos& qos) {
  const auto topic = wire::make_state_topic<State>(participant);
  if (!topic) return tl::make_unexpected(topic.error());
  wire::dds::DataWriter* writer = publisher.create_datawriter(*topic, qos);
  if (writer == nullptr) return failure(ErrorCode::kInternal, "cannot create the writer of {}", State::kName);
  return writer;
}

}  // namespace

Result<std::unique_ptr<ReplicaLink>> ReplicaLink::open(wire::dds::DomainParticipant& participant,
                                                       wire::dds::Subscriber& subscriber, wire::dds::Topic& snapshots,
                                                       const std::string& server, const ReplicaOptions& options,
                                                       Trainer& trainer, Store& store, ReplicaListener listener) {
  if (options.role == ReplicaOptions::Role::kAlone) return nullptr;
  std::unique_ptr<ReplicaLink> link(new ReplicaLink(subscriber, server, wire::participant_of(participant.guid()),
                                                    options, trainer, store, std::move(listener)));
  trainer.set_decides(false);  // until it has looked round
  link->begun_ = link->begin();
  if (const Status opened = link->open_endpoints(participant, snapshots); !opened)
    return tl::make_unexpected(opened.error());
  ReplicaLink* self = link.get();
  link->replicas_thread_ = std::jthread([self](const std::stop_token& stop) { self->run(stop); });
  link->sender_.start([writer = link->copy_writer_](wire::BatchCopy& copy) { writer->write(&copy); });
  return link;
}

ReplicaLink::ReplicaLink(wire::dds::Subscriber& subscriber, std::string server, std::string participant,
                         const ReplicaOptions& options, Trainer& trainer, Store& store, ReplicaListener listener)
    : subscriber_(subscriber),
      server_(std::move(server)),
      participant_(std::move(participant)),
      trainer_(trainer),
      store_(store),
      listener_(std::move(listener)),
      sender_(
          server_, options, trainer, store, [this](const std::string& cell) { return followers_of(cell); },
          [this](const std::string& trouble) { set_trouble("batches", trouble); }, listener_),
      role_(server_, options, Clock::now()) {}

ReplicaLink::~ReplicaLink() {
  replicas_thread_.request_stop();
  wake();
  if (replicas_thread_.joinable()) replicas_thread_.join();
  sender_.stop();
}

bool ReplicaLink::begin() {
  const auto view = store_.replica_view();
  if (!view) return false;
  const MutexLock lock(mutex_);
  const RoleDecision decision = role_.begin(view->record);
  record_ = decision.record;
  epoch_ = record_.epoch;
  return view->record == decision.record || store_.keep_replica_record(decision.record, decision.why).has_value();
}

Status ReplicaLink::open_endpoints(wire::dds::DomainParticipant& participant, wire::dds::Topic& snapshots) {
  publisher_ = participant.create_publisher(wire::publisher_qos({}));
  if (publisher_ == nullptr) return failure(ErrorCode::kInternal, "cannot create the publisher of replicas");
  auto status = make_writer<wire::ReplicaStatusTopic>(participant, *publisher_, wire::state_writer_qos());
  auto copy = make_writer<wire::BatchCopyTopic>(participant, *publisher_, wire::call_writer_qos(wire::kReplyDepth));
  auto copied = make_writer<wire::BatchCopiedTopic>(participant, *publisher_, wire::call_writer_qos(wire::kReplyDepth));
  for (const auto* made : {&status, &copy, &copied}) {
    if (!*made) return tl::make_unexpected(made->error());
  }
  status_writer_ = *status;
  copy_writer_ = *copy;
  copied_writer_ = *copied;
  const auto topic_of = [](const wire::dds::DataWriter* writer) {
    return Result<wire::dds::Topic*>(writer->get_topic());
  };
  auto statuses = wire::StateReader<wire::ReplicaStatusTopic>::open(
      topic_of(status_writer_), subscriber_, wire::state_reader_qos(),
      [this](const wire::ReplicaStatus* sample, const std::string& from, double) { on_status(sample, from); });
  if (!statuses) return tl::make_unexpected(statuses.error());
  status_reader_ = std::move(*statuses);
  snapshots_topic_ = &snapshots;
  if (const Status listens = listen_to_snapshots(); !listens) return listens;
  auto copies = wire::StateReader<wire::BatchCopyTopic>::open(
      topic_of(copy_writer_), subscriber_, wire::call_reader_qos(wire::kRequestDepth),
      [this](const wire::BatchCopy* sample, const std::string& from, double) { on_copy(sample, from); });
  if (!copies) return tl::make_unexpected(copies.error());
  copy_reader_ = std::move(*copies);
  auto answers = wire::StateReader<wire::BatchCopiedTopic>::open(
      topic_of(copied_writer_), subscriber_, wire::call_reader_qos(wire::kRequestDepth),
      [this](const wire::BatchCopied* sample, const std::string& from, double) { on_copied(sample, from); });
  if (!answers) return tl::make_unexpected(answers.error());
  copied_reader_ = std::move(*answers);
  return {};
}

Status ReplicaLink::listen_to_snapshots() {
  const MutexLock lock(listening_);
  auto models = wire::StateReader<wire::ModelSnapshotTopic>::open(
      Result<wire::dds::Topic*>(snapshots_topic_), subscriber_, wire::state_reader_qos(),
      [this](const wire::ModelSnapshot* sample, const std::string&, double) { on_snapshot(sample); });
  if (!models) return tl::make_unexpected(models.error());
  snapshot_reader_ = std::move(*models);
  return {};
}

Status ReplicaLink::cells_added() {
  sender_.look_again();
  wake();
  return listen_to_snapshots();
}

void ReplicaLink::wake() {
  {
    const MutexLock lock(mutex_);
    woken_ = true;
  }
  changed_.notify_all();
}

void ReplicaLink::on_status(const wire::ReplicaStatus* status, const std::string& participant) {
  bool is_other = false;  // than it was
  {
    const MutexLock lock(mutex_);
    woken_ = true;
    if (status == nullptr) {
      std::erase_if(heard_, [&](const auto& entry) { return entry.second.participant == participant; });
      namesakes_.erase(participant);
    } else if (const std::string name = status->server().to_string(); name != server_) {
      Heard& heard = heard_[name];
      const bool follows_anew = heard.status.follows().to_string() != status->follows().to_string();
      const bool has_more_cells = heard.status.cells().size() < status->cells().size();
      is_other = heard.participant != participant || follows_anew || has_more_cells;
      heard = {participant, *status, Clock::now()};
    } else if (participant != participant_) {
      namesakes_.insert(participant);
    }
  }
  changed_.notify_all();
  if (is_other) sender_.look_again(participant);
}

void ReplicaLink::on_snapshot(const wire::ModelSnapshot* snapshot) {
  if (snapshot == nullptr || snapshot->server() == server_) return;
  const std::string cell = snapshot->cell().to_string();
  if (!trainer_.cells().contains(cell)) return;
  {
    const MutexLock lock(mutex_);
    woken_ = true;
    snapshots_[{snapshot->server(), cell}] = {snapshot->hash(), snapshot->text()};
  }
  changed_.notify_all();
}

void ReplicaLink::on_copy(const wire::BatchCopy* copy, const std::string& participant) {
  if (copy == nullptr || copy->to().to_string() != server_) return;
  {
    const MutexLock lock(mutex_);
    if (!is_its_own(copy->server().to_string(), participant) || !has_room_for(*copy)) return;
    woken_ = true;
    arrived_.push_back(*copy);
  }
  changed_.notify_all();
}

bool ReplicaLink::is_its_own(const std::string& server, const std::string& participant) const {
  const auto heard = heard_.find(server);
  return heard != heard_.end() && heard->second.participant == participant;
}

bool ReplicaLink::has_room_for(const wire::BatchCopy& copy) const {
  std::size_t bytes = copy.csv().size();
  for (const wire::BatchCopy& waiting : arrived_) bytes += waiting.csv().size();
  return arrived_.empty() || (arrived_.size() < kCopiesAtOnce && bytes <= kCopiedBytesAtOnce);
}

void ReplicaLink::on_copied(const wire::BatchCopied* copied, const std::string& participant) {
  if (copied == nullptr || copied->to().to_string() != server_) return;
  {
    const MutexLock lock(mutex_);
    if (!is_its_own(copied->server().to_string(), participant)) return;
  }
  sender_.answered(participant, *copied);
}

std::optional<ChangesElsewhere> ReplicaLink::changes_elsewhere() const {
  const MutexLock lock(mutex_);
  if (may_change_) return std::nullopt;
  if (record_.writes) return ChangesElsewhere{"", "it has just started, and looks round who else writes"};
  const auto writer = heard_.find(record_.follows);
  const bool is_there = writer != heard_.end() && writer->second.status.role() == wire::REPLICA_WRITER;
  if (is_there) return ChangesElsewhere{record_.follows, fmt::format("{} follows {}", server_, record_.follows)};
  return ChangesElsewhere{"", fmt::format("{} follows {}, which is not there, and no other server writes", server_,
                                          record_.follows.empty() ? "nobody" : record_.follows)};
}

void ReplicaLink::set_options(const ReplicaOptions& options) {
  {
    const MutexLock lock(mutex_);
    new_options_ = options;
  }
  wake();
}

void ReplicaLink::run(const std::stop_token& stop) {
  ::pthread_setname_np(::pthread_self(), "replicas");
  while (!stop.stop_requested()) {
    step();
    MutexLock lock(mutex_);
    changed_.wait_for(lock, stop, kStep, [this]() TRAMMEL_REQUIRES(mutex_) { return woken_; });
    woken_ = false;
  }
}

std::vector<OtherReplica> ReplicaLink::others() const {
  std::vector<OtherReplica> all;
  const MutexLock lock(mutex_);
  for (const auto& [name, heard] : heard_) {
    if (Clock::now() - heard.at > wire::kStatusLost) continue;  // it hangs
    const wire::ReplicaStatus& status = heard.status;
    OtherReplica other{name, status.role() == wire::REPLICA_WRITER, status.follows().to_string(), status.epoch()};
    bool shares = false;
    for (const wire::ReplicaCell& cell : status.cells()) {
      if (!trainer_.cells().contains(cell.cell().to_string())) continue;
      shares = true;
      other.newest[cell.cell().to_string()] = cell.newest();
      if (cell.version() > 0) other.cells[cell.cell().to_string()] = {cell.version(), cell.hash()};
    }
    if (shares) all.push_back(std::move(other));
  }
  return all;
}

void ReplicaLink::step() {
  if (!begun_) begun_ = begin();  // a store that cannot be written yet
  if (!begun_) return;
  const std::vector<OtherReplica> there = others();
  // After the others: what they have of this server is never newer than what its store says then.
  auto view = store_.replica_view();
  if (!view || !view->record) return;  // the store's trouble is told by others
  const RoleDecision decision = decide(*view->record, there);
  take_on(decision, *view->record);
  set_trouble("role", decision.trouble);
  keep_copies();
  number_after(there, *view);
  if (decision.leader != nullptr) follow(*decision.leader, *view);
  if (decision.record.writes) set_trouble("follow", "");
  view = store_.replica_view();
  if (!view || !view->record) return;
  {
    const MutexLock lock(mutex_);
    record_ = *view->record;
  }
  epoch_ = view->record->epoch;
  forget_known_snapshots();
  look_for_namesakes();
  look_for_divergence(there, *view);
  tell_troubles();
  publish(*view);
  // After clients can know it: whoever reads this line and asks at once is to reach the right server.
  if (const auto news = std::exchange(new_part_, std::nullopt); news && listener_) listener_(*news);
}

RoleDecision ReplicaLink::decide(const ReplicaRecord& record, const std::vector<OtherReplica>& others) {
  const MutexLock lock(mutex_);
  record_ = record;
  if (!new_options_) return role_.decide(record, others, Clock::now());
  const RoleDecision told = role_.told(record, *new_options_, others);
  sender_.set_options(role_.options());
  new_options_.reset();
  return told;
}

void ReplicaLink::take_on(const RoleDecision& decision, const ReplicaRecord& before) {
  // First it stops, then it is remembered; and the other way round where it begins.
  if (!decision.record.writes) set_may_change(false);
  if (decision.record != before) {
    if (const Status kept = store_.keep_replica_record(decision.record, decision.why); !kept) return;
    if (decision.record.writes != before.writes)
      new_part_ = {"replica_role",
                   fmt::format("{} {} from now on: {}", server_,
                               decision.record.writes ? "writes" : "follows " + decision.record.follows, decision.why),
                   true};
  }
  if (decision.record.writes) set_may_change(true);
}

void ReplicaLink::set_may_change(bool may) {
  {
    const MutexLock lock(mutex_);
    may = may && role_.has_looked(Clock::now());
    if (may == may_change_) return;
  }
  // Copies first and last: no change is acknowledged without them.
  if (may) sender_.set_writes(true);
  {
    const MutexLock lock(mutex_);
    may_change_ = may;
  }
  trainer_.set_decides(may);
  if (!may) sender_.set_writes(false);
}

void ReplicaLink::number_after(const std::vector<OtherReplica>& others, const ReplicaView& view) {
  for (const OtherReplica& other : others) {
    for (const auto& [cell, newest] : other.newest) {
      const auto known = view.newest.find(cell);
      if (newest > (known == view.newest.end() ? 0 : known->second))
        static_cast<void>(store_.number_after(cell, newest));  // else with the next step
    }
  }
}

void ReplicaLink::follow(const OtherReplica& leader, const ReplicaView& view) {
  std::string wrong;
  bool has_all = true;
  for (const auto& [cell, wanted] : leader.cells) {
    const auto present = view.cells.find(cell);
    const bool is_in_force = present != view.cells.end() && present->second.hash == wanted.hash;
    if (is_in_force && trainer_.serves(cell, wanted.hash)) continue;
    if (const Status followed = follow_cell(cell, wanted, leader.server); followed) continue;
    has_all = false;
    const std::string why = why_not_followed(cell, wanted);
    if (!why.empty())
      wrong += fmt::format("{}cell {}: version {} of {} is not served: {}", wrong.empty() ? "" : "; ", cell,
                           wanted.version, leader.server, why);
  }
  if (has_all) awaited_since_.clear();
  set_trouble("follow", wrong);
  if (!has_all || leader.epoch <= view.record->epoch) return;
  ReplicaRecord record = *view.record;
  record.epoch = leader.epoch;
  record.follows = leader.server;
  static_cast<void>(store_.keep_replica_record(record, ""));  // else with the next step
}

Status ReplicaLink::follow_cell(const std::string& cell, const VersionInForce& wanted, const std::string& leader) {
  const auto before = not_followed_.find(cell);
  if (before != not_followed_.end() && before->second.first == wanted.hash)
    return tl::make_unexpected(before->second.second);
  const auto stored = store_.has_model(cell, wanted.hash);
  if (!stored) return tl::make_unexpected(stored.error());
  const bool is_stored = *stored && !not_loaded_.contains(wanted.hash);
  std::string text;
  if (!is_stored) {
    const MutexLock lock(mutex_);
    const auto snapshot = snapshots_.find({leader, cell});
    if (snapshot == snapshots_.end() || snapshot->second.hash != wanted.hash)
      return failure(ErrorCode::kBusy, "it has not come yet");
    text = snapshot->second.text;
  }
  ChangeId by;
  by.who = leader;
  const auto adopted = trainer_.adopt(cell, wanted, text, by);
  if (adopted) {
    not_followed_.erase(cell);
    not_loaded_.erase(wanted.hash);
    return {};
  }
  if (is_stored && adopted.error().code != ErrorCode::kBusy) return ask_again_for(wanted.hash);
  if (adopted.error().code != ErrorCode::kBusy) not_followed_[cell] = {wanted.hash, adopted.error()};
  return tl::make_unexpected(adopted.error());
}

Status ReplicaLink::ask_again_for(const std::string& hash) {
  not_loaded_.insert(hash);
  if (const Status listens = listen_to_snapshots(); !listens) return listens;
  return failure(ErrorCode::kBusy, "what is stored of it cannot be loaded, and it has not come again yet");
}

std::string ReplicaLink::why_not_followed(const std::string& cell, const VersionInForce& wanted) {
  if (const auto why = not_followed_.find(cell); why != not_followed_.end()) return sentence(why->second.second);
  const auto [awaited, is_new] = awaited_since_.try_emplace(cell + "/" + wanted.hash, Clock::now());
  if (Clock::now() - awaited->second < kModelComes) return {};
  return "it does not come; export it there and import it here if it is too large to be sent";
}

void ReplicaLink::forget_known_snapshots() {
  std::vector<std::pair<std::string, std::string>> known;  // cell and hash
  {
    const MutexLock lock(mutex_);
    for (const auto& [of, snapshot] : snapshots_) known.emplace_back(of.second, snapshot.hash);
  }
  std::erase_if(known, [&](const auto& one) {
    return not_loaded_.contains(one.second) || !store_.has_model(one.first, one.second).value_or(false);
  });
  const MutexLock lock(mutex_);
  std::erase_if(snapshots_, [&](const auto& entry) {
    return std::find(known.begin(), known.end(), std::pair(entry.first.second, entry.second.hash)) != known.end();
  });
}

void ReplicaLink::keep_copies() {
  std::deque<wire::BatchCopy> arrived;
  std::string leader;
  {
    const MutexLock lock(mutex_);
    arrived.swap(arrived_);
    leader = record_.writes ? "" : record_.follows;
  }
  for (const wire::BatchCopy& copy : arrived) {
    const std::string from = copy.server().to_string();
    wire::BatchCopied answer;
    answer.server(server_);
    answer.to(from);
    answer.number(copy.number());
    // Not yet, or no longer: that passes.
    const Status kept = from == leader ? trainer_.adopt_batch(batch_in(copy), from)
                                       : Status(failure(ErrorCode::kBusy, "{} does not follow {}", server_, from));
    if (!kept) {
      answer.result(to_wire(kept.error().code));
      answer.why(cut(sentence(kept.error()), wire::MAX_SENTENCE));
    }
    copied_writer_->write(&answer);
  }
}

void ReplicaLink::look_for_namesakes() {
  bool is_alone = true;
  {
    const MutexLock lock(mutex_);
    is_alone = namesakes_.empty();
  }
  set_trouble("name", is_alone
                          ? ""
                          : fmt::format("another server is called {} too: neither sees what the other one decides; "
                                        "give one of them another name (server in its file)",
                                        server_));
}

void ReplicaLink::look_for_divergence(const std::vector<OtherReplica>& others, const ReplicaView& view) {
  std::map<std::string, Clock::time_point> since;
  std::string said;
  for (const OtherReplica& other : others) {
    if (other.epoch != view.record->epoch) continue;
    for (const auto& [cell, there] : other.cells) {
      const auto here = view.cells.find(cell);
      if (here == view.cells.end() || here->second.hash == there.hash) continue;
      const std::string key = other.server + "/" + cell;
      const auto before = divergent_since_.find(key);
      since[key] = before == divergent_since_.end() ? Clock::now() : before->second;
      if (Clock::now() - since[key] < kDivergent) continue;
      said += (said.empty() ? "" : "; ") +
              fmt::format("cell {}: {} serves version {} and {} version {}, both at epoch {}, and they differ", cell,
                          server_, here->second.version, other.server, there.version, other.epoch);
    }
  }
  divergent_since_ = std::move(since);
  set_trouble("divergence", said);
}

void ReplicaLink::publish(const ReplicaView& view) {
  wire::ReplicaStatus status;
  status.server(server_);
  status.role(view.record->writes ? wire::REPLICA_WRITER : wire::REPLICA_FOLLOWER);
  status.follows(view.record->follows);
  status.epoch(view.record->epoch);
  for (const auto& [name, cell] : trainer_.cells()) {
    wire::ReplicaCell one;
    one.cell(name);
    if (const auto found = view.cells.find(name); found != view.cells.end()) {
      one.version(found->second.version);
      one.hash(found->second.hash);
    }
    if (const auto found = view.newest.find(name); found != view.newest.end()) one.newest(found->second);
    status.cells().push_back(one);
  }
  status.trouble(cut(fmt::format("{}", fmt::join(troubles(), "; ")), wire::MAX_SENTENCE));
  const bool is_new = !published_ || !(*published_ == status);
  if (!is_new && Clock::now() - published_at_ < wire::kStatusPeriod) return;
  status_writer_->write(&status);
  published_ = std::move(status);
  published_at_ = Clock::now();
}

void ReplicaLink::set_trouble(const std::string& kind, const std::string& what) {
  const MutexLock lock(mutex_);
  if (what.empty()) {
    troubles_.erase(kind);
  } else {
    troubles_[kind] = what;
  }
}

std::vector<std::string> ReplicaLink::troubles() const {
  std::vector<std::string> all;
  const MutexLock lock(mutex_);
  for (const auto& [kind, what] : troubles_) all.push_back(what);
  return all;
}

void ReplicaLink::tell_troubles() {
  std::vector<std::string> now = troubles();
  const auto missing = [](const std::vector<std::string>& among, const std::string& one) {
    return std::find(among.begin(), among.end(), one) == among.end();
  };
  for (const std::string& what : now) {
    if (listener_ && missing(told_, what)) listener_({"replica_trouble", what});
  }
  for (const std::string& what : told_) {
    if (listener_ && missing(now, what)) listener_({"replica_trouble_over", "over: " + what, true});
  }
  told_ = std::move(now);
}

ReplicaFigures ReplicaLink::figures() const {
  const MutexLock lock(mutex_);
  ReplicaFigures now;
  now.writes = may_change_;
  now.epoch = record_.epoch;
  now.others = heard_.size();
  for (const auto& [kind, what] : troubles_) now.troubles.push_back(kind);
  return now;
}

std::map<std::string, std::string> ReplicaLink::followers_of(const std::string& cell) const {
  std::map<std::string, std::string> followers;
  const MutexLock lock(mutex_);
  for (const auto& [name, heard] : heard_) {
    const auto& cells = heard.status.cells();
    const bool serves =
        std::any_of(cells.begin(), cells.end(), [&](const auto& one) { return one.cell().to_string() == cell; });
    if (serves && heard.status.follows().to_string() == server_) followers[name] = heard.participant;
  }
  return followers;
}

}  // namespace trammel
