#include "clients/session/session.h"

#include <algorithm>
#include <functional>
#include <map>
#include <optional>
#include <random>
#include <set>
#include <tuple>
#include <utility>

#include "clients/session/caller.h"
#include "clients/session/convert.h"
#include "clients/session/parts.h"
#include "clients/session/server_watch.h"
#include "idl/limits.h"
#include "idl/places.h"
#include "idl/quiet_library.h"
#include "server/base/mutex.h"

namespace trammel::client {
namespace {

/// Share of the timeout that one part of a long call should take. At half of the timeout a request is sent again; this
/// is far below.
constexpr double kShareOfTimeout = 0.1;
constexpr std::uint32_t kHighestDomain = 232;  // of ports that are numbers of UDP
constexpr std::chrono::milliseconds kJobPoll{2000};
constexpr std::size_t kHomesRemembered = 1000;  // of a session's jobs
constexpr std::chrono::milliseconds kLook{50};  // between two looks at what servers say
constexpr int kShareOfLooking = 2;              // of the timeout: its half at most, for discovery servers
constexpr std::uint32_t kLeastPatience = 10;    // ms, before a busy server is asked again

/// A unique name, also across hosts: 128 random bits.
std::string make_name(const char* what) {
  std::random_device random;
  return fmt::format("{}-{:08x}{:08x}{:08x}{:08x}", what, random(), random(), random(), random());
}

std::string change_id(const ChangeOptions& options) { return options.id.empty() ? make_name("change") : options.id; }

wire::Change to_wire(const ChangeOptions& options) {
  wire::Change change;
  change.id(change_id(options));
  change.expected_version(options.expected_version.value_or(-1));
  return change;
}

/// Whether two servers tell of one job: they have one record.
bool is_same(const wire::Job& a, const wire::Job& b) {
  return a.number() == b.number() && a.cell() == b.cell() && a.kind() == b.kind() &&
         a.created_unix_s() == b.created_unix_s() && a.batch_ids() == b.batch_ids();
}

/// Adds what no other server has told already: several have one record.
template <typename Item, typename IsSame>
void add_new(std::vector<std::pair<Item, std::string>>& all, const std::vector<Item>& told, const std::string& server,
             const IsSame& is_same) {
  const auto before = static_cast<std::ptrdiff_t>(all.size());  // a server tells each once
  for (const Item& item : told) {
    const auto known = [&](const auto& other) { return is_same(other.first, item); };
    if (std::none_of(all.begin(), all.begin() + before, known)) all.emplace_back(item, server);
  }
}

/// Refuses a text with a NUL: strings on the wire end there, and the rest would be lost silently.
Status check_text(const std::string& what, const std::string& text) {
  if (const std::size_t nul = text.find('\0'); nul != std::string::npos) {
    const auto line = 1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(nul), '\n');
    return refused("a NUL byte, not text").in(what).at_row(line);
  }
  if (text.size() <= wire::kMaxText) return {};
  return failure(ErrorCode::kTooLarge, "{} bytes, limit {}", text.size(), wire::kMaxText)
      .in(what)
      .beyond(text.size(), wire::kMaxText);
}

bool is_over(const JobStatus& job) { return job.stage == "done" || job.stage == "failed" || job.stage == "cancelled"; }

/// An operation's endpoints, made when it is first called: every client hears of every endpoint that the server has for
/// another one.
template <typename Operation>
struct Endpoints {
  Mutex mutex;
  std::unique_ptr<Caller<Operation>> caller TRAMMEL_GUARDED_BY(mutex);
};

/// Adds the servers that the discovery servers tell of. It does without any where others are named.
Status add_found_places(SessionOptions& options) {
  const auto places =
      wire::look_for_places(options.discovery_servers, options.domain, options.timeout / kShareOfLooking);
  if (!places) return options.servers.empty() ? Status(tl::make_unexpected(places.error())) : Status();
  for (const HostPort& place : *places) {
    if (std::find(options.servers.begin(), options.servers.end(), place) == options.servers.end())
      options.servers.push_back(place);
  }
  return {};
}

/// The same options with every server as a place, and the address of this host that leads there.
Result<SessionOptions> completed(SessionOptions options) {
  if (!options.discovery_servers.empty()) {
    if (const Status found = add_found_places(options); !found) return tl::make_unexpected(found.error());
  }
  if (options.servers.empty()) {
    for (const std::uint16_t port : options.server_ports) options.servers.push_back({options.address, port});
    return options;
  }
  return own_address_towards(options.servers.front().address).map([&](std::string address) {
    options.address = std::move(address);
    return options;
  });
}

Result<wire::ParticipantPtr> participant_of(const SessionOptions& options) {
  if (options.domain > kHighestDomain)
    return failure(ErrorCode::kUsage, "domain is {}, limit {}", options.domain, kHighestDomain)
        .of("domain")
        .beyond(options.domain, kHighestDomain);
  wire::ParticipantOptions how;
  how.name = "trammel client";
  how.domain = options.domain;
  how.address = options.address;
  how.peers = options.servers;
  if (!options.security.empty()) {
    auto security = wire::read_security(options.security);
    if (!security) return tl::make_unexpected(security.error());
    how.security = std::move(*security);
  }
  return wire::make_participant(how);
}

}  // namespace

/// Members are destroyed from the last to the first.
struct Session::Participant {
  SessionOptions options;
  wire::ParticipantPtr participant;
  std::unique_ptr<ServerWatch> watch;
  std::string partition;
  wire::dds::Publisher* request_publisher = nullptr;
  wire::dds::Subscriber* reply_subscriber = nullptr;
  std::tuple<Endpoints<wire::PredictError>, Endpoints<wire::CorrectTarget>, Endpoints<wire::SubmitMeasurements>,
             Endpoints<wire::Train>, Endpoints<wire::Diagnose>, Endpoints<wire::CheckHealth>,
             Endpoints<wire::ReadModels>, Endpoints<wire::ManageModels>, Endpoints<wire::ReleaseBatches>>
      endpoints;
  Mutex homes_mutex;
  std::map<std::int64_t, std::set<std::string>> homes TRAMMEL_GUARDED_BY(homes_mutex);  // this session's jobs' servers

  [[nodiscard]] Clock::time_point deadline() const { return Clock::now() + options.timeout; }

  /// For error messages: how long it looked, on which ports, in which domain.
  [[nodiscard]] std::string where_it_looked() const {
    std::string places;
    for (const HostPort& place : options.servers) places += " " + to_string(place);
    return fmt::format("{} ms, looking at{} in domain {}", options.timeout.count(), places, options.domain);
  }

  /// Where no server answered. One that refuses a certificate is as silent as one that is not there.
  [[nodiscard]] Error not_answered(Error error) const {
    if (options.security.empty()) return error;
    return Failure(std::move(error))
        .next(
            fmt::format("see that one runs there, and that its certificates and those in {} are of the same plant and "
                        "not over: the server's log names whom it refused",
                        options.security))
        .value();
  }

  /// An error reply of the server is an error here, and one of no server says where it was looked for.
  template <typename Reply>
  [[nodiscard]] Result<Reply> as_result(Result<Reply> reply) const {
    if (!reply && reply.error().code == ErrorCode::kUnreachable) {
      Error error = reply.error();
      error.message += fmt::format(" ({})", where_it_looked());
      return Failure(not_answered(std::move(error))).of("server").with_text(where_it_looked());
    }
    if (reply && reply->header().result() != wire::RESULT_OK) return tl::make_unexpected(error_of(reply->header()));
    return reply;
  }

  /// Refused where the permissions do not allow it.
  template <typename Operation>
  [[nodiscard]] Result<Caller<Operation>*> caller_of() {
    auto& made = std::get<Endpoints<Operation>>(endpoints);
    const MutexLock lock(made.mutex);
    if (made.caller) return made.caller.get();
    const bool may_be_forbidden = !options.security.empty();
    std::optional<wire::QuietLibrary> quiet;
    if (may_be_forbidden) quiet.emplace();
    auto opened = Caller<Operation>::open(*participant, *request_publisher, *reply_subscriber, partition, *watch);
    if (!opened && may_be_forbidden) return not_allowed(Operation::kName);
    if (!opened) return tl::make_unexpected(opened.error());
    made.caller = std::move(*opened);
    return made.caller.get();
  }

  /// Sends one request. A server that is busy has not done it and is asked again when it says, until the deadline; a
  /// change keeps its id.
  template <typename Operation>
  [[nodiscard]] Result<typename Operation::Reply::type> call(const typename Operation::Request::type& request,
                                                             const Route& route) {
    const auto caller = caller_of<Operation>();
    if (!caller) return tl::make_unexpected(caller.error());
    const auto until = deadline();
    while (true) {
      auto reply = (*caller)->call(request, route, until);
      const bool is_busy = reply && reply->header().result() == wire::RESULT_BUSY;
      const auto again = Clock::now() + std::chrono::milliseconds(
                                            is_busy ? std::max(reply->header().retry_after_ms(), kLeastPatience) : 0);
      if (!is_busy || again >= until) return as_result(std::move(reply));
      watch->wait_until(again);
    }
  }

  [[nodiscard]] Result<wire::ManageModelsReply> manage(const std::string& cell, wire::ManageAction action,
                                                       const ChangeOptions& change,
                                                       wire::ManageModelsRequest request = {},
                                                       const std::string& server = {}) {
    request.about().cell(cell);
    request.action(action);
    request.change(to_wire(change));
    request.reason(change.reason);
    return call<wire::ManageModels>(request, {cell, server, true, false, record_of(server)});
  }

  [[nodiscard]] Result<std::int64_t> release(const std::string& cell, const std::vector<std::string>& batch_ids,
                                             const ChangeOptions& change, wire::ReleaseBatchesRequest request) {
    request.about().cell(cell);
    request.batch_ids(batch_ids);
    request.change(to_wire(change));
    request.reason(change.reason);
    const auto reply = call<wire::ReleaseBatches>(request, {cell, {}, true});
    if (!reply) return tl::make_unexpected(reply.error());
    return accepted(*reply);
  }

  /// From `server`, or from another one of its `record`; empty: from any.
  [[nodiscard]] Result<wire::ReadModelsReply> read(const std::string& cell, const std::string& server,
                                                   wire::ReadKind what, wire::ReadModelsRequest request = {},
                                                   const std::string& record = {}) {
    request.about().cell(cell);
    request.what(what);
    return call<wire::ReadModels>(request, {cell, server, false, true, record});
  }
  [[nodiscard]] std::string record_of(const std::string& server) const {
    return server.empty() ? std::string() : watch->record_of(server);
  }

  /// From every server.
  [[nodiscard]] Result<std::vector<wire::ReadModelsReply>> read_all(const std::string& cell, wire::ReadKind what,
                                                                    const wire::ReadModelsRequest& asked = {}) {
    const auto known = watch->wait_for_servers(options.servers.size(), deadline());
    if (known.empty()) return tl::make_unexpected(no_server());
    std::vector<wire::ReadModelsReply> replies;
    for (const KnownServer& server : known) {
      auto reply = read(cell, server.id(), what, asked);
      if (!reply) return tl::make_unexpected(reply.error());
      replies.push_back(std::move(*reply));
    }
    return replies;
  }

  [[nodiscard]] Failure not_allowed(const char* operation) const {
    return refused("these permissions do not allow {}", operation)
        .in(options.security)
        .next("whoever issues permissions gives a role that may; see deploy/security/README.md");
  }

  [[nodiscard]] Error no_server() const {
    if (auto other = watch->other_contract()) return *other;
    return not_answered(failure(ErrorCode::kUnreachable, "no server found ({})", where_it_looked()).value());
  }

  /// What `server`, or another one of its record, knows of the job.
  [[nodiscard]] Result<wire::Job> job(const std::string& server, std::int64_t number) {
    wire::ReadModelsRequest request;
    request.job(number);
    auto reply = read({}, server, wire::READ_JOB, std::move(request), record_of(server));
    if (!reply) return tl::make_unexpected(reply.error());
    if (reply->jobs().size() != 1) return failure(ErrorCode::kInternal, "server {} answered no job", server);
    return reply->jobs().front();
  }

  /// The job that was accepted, and remembers by whom: every server counts its own jobs.
  template <typename Reply>
  [[nodiscard]] std::int64_t accepted(const Reply& reply) {
    const MutexLock lock(homes_mutex);
    homes[reply.job()].insert(reply.header().server().to_string());
    if (homes.size() > kHomesRemembered) homes.erase(homes.begin());
    return reply.job();
  }
  /// The job is over, as this session has been told.
  void told(std::int64_t number, const std::string& server) {
    const MutexLock lock(homes_mutex);
    const auto found = homes.find(number);
    if (found != homes.end() && found->second.erase(server) > 0 && found->second.empty()) homes.erase(found);
  }
  /// The servers that accepted a job of this number in this session, and have not told its end; without one all that
  /// are known.
  [[nodiscard]] std::set<std::string> may_have(std::int64_t number) {
    {
      const MutexLock lock(homes_mutex);
      if (const auto found = homes.find(number); found != homes.end()) return found->second;
    }
    std::set<std::string> servers;
    for (const KnownServer& server : watch->wait_for_servers(options.servers.size(), deadline()))
      servers.insert(server.id());
    return servers;
  }

  /// The server that has the job (of `cell`; empty: of any), and its present state. Refused where several have one.
  [[nodiscard]] Result<std::pair<std::string, wire::Job>> find_job(std::int64_t number, const std::string& cell = {}) {
    std::optional<std::pair<std::string, wire::Job>> found;
    Error last = no_server();
    for (const std::string& server : may_have(number)) {
      const std::string record = record_of(server);
      if (found && !record.empty() && record == record_of(found->first)) continue;
      auto asked = job_of_cell(server, number, cell);
      if (!asked) last = asked.error();
      if (!asked) continue;
      if (found) return ambiguous(number, found->first, server);
      found = std::pair(server, std::move(*asked));
    }
    if (!found) return tl::make_unexpected(last);
    return *std::move(found);
  }
  [[nodiscard]] Result<wire::Job> job_of_cell(const std::string& server, std::int64_t number, const std::string& cell) {
    auto asked = job(server, number);
    if (!asked || cell.empty() || asked->cell() == cell) return asked;
    return failure(ErrorCode::kNotFound, "job {} of server {} is of cell {}, not of {}", number, server, asked->cell(),
                   cell);
  }
  [[nodiscard]] static Failure ambiguous(std::int64_t number, const std::string& one, const std::string& other) {
    return refused("servers {} and {} both have a job {}: each counts its own", one, other, number)
        .next("name one of them alone");
  }

  /// Sends `items` in parts, all to be answered by one model.
  template <typename Operation, typename Item, typename Wire, typename Put, typename Get>
  [[nodiscard]] Result<Answer<Item>> call_in_parts(const CallContext& context, const std::vector<Wire>& items,
                                                   const ShareListener& progress, const Put& put, const Get& get) {
    const AskPart<Item> ask = [&](std::size_t first, std::size_t count) -> Result<Answer<Item>> {
      typename Operation::Request::type request;
      request.about(to_wire(context));
      for (std::size_t i = first; i < first + count; ++i) put(request).push_back(items[i]);
      const auto reply = call<Operation>(request, {context.cell});
      if (!reply) return tl::make_unexpected(reply.error());
      if (get(*reply).size() != count) {
        return failure(ErrorCode::kInternal, "server {} answered {} items for {}", reply->header().server().to_string(),
                       get(*reply).size(), count);
      }
      Answer<Item> answer;
      answer.model = from_wire(reply->model());
      for (const auto& item : get(*reply)) answer.items.push_back(from_wire(item));
      return answer;
    };
    const PartSize size(kShareOfTimeout * PartSize::Seconds(options.timeout), wire::kTargetsPerRequest);
    return ask_in_parts<Item>(items.size(), context.cell, size, ask, progress,
                              [] { return PartSize::Seconds(Clock::now().time_since_epoch()); });
  }
};

Result<std::string> check_security(const std::string& folder) {
  return wire::read_security(folder).map([](const wire::Security& security) { return security.subject; });
}

Result<std::unique_ptr<Session>> Session::open(const SessionOptions& asked) {
  auto inside = std::make_unique<Participant>();
  auto options = completed(asked);
  if (!options) return tl::make_unexpected(options.error());
  inside->options = *std::move(options);
  auto participant = participant_of(inside->options);
  if (!participant) return tl::make_unexpected(participant.error());
  inside->participant = std::move(*participant);

  inside->partition = make_name("client");
  inside->request_publisher = inside->participant->create_publisher(wire::publisher_qos({}));
  inside->reply_subscriber = inside->participant->create_subscriber(wire::subscriber_qos(inside->partition));
  wire::dds::Subscriber* states = inside->participant->create_subscriber(wire::subscriber_qos({}));
  if (inside->request_publisher == nullptr || inside->reply_subscriber == nullptr || states == nullptr) {
    return failure(ErrorCode::kInternal, "cannot create the publisher and the subscribers of a session");
  }
  auto watch = ServerWatch::open(*inside->participant, *states, inside->options.servers.size());
  if (!watch) return tl::make_unexpected(watch.error());
  inside->watch = std::move(*watch);
  return std::unique_ptr<Session>(new Session(std::move(inside)));
}

Session::Session(std::unique_ptr<Participant> participant) : participant_(std::move(participant)) {}

Session::~Session() = default;

Result<Answer<PredictedError>> Session::predict_error(const CallContext& context,
                                                      const std::vector<std::vector<double>>& joints_rad,
                                                      const ShareListener& progress) {
  std::vector<CommandedJoints> poses;
  poses.reserve(joints_rad.size());
  for (const auto& q_rad : joints_rad) poses.push_back({q_rad});
  return predict_error_at(context, poses, progress);
}

Result<Answer<PredictedError>> Session::predict_error_at(const CallContext& context,
                                                         const std::vector<CommandedJoints>& poses,
                                                         const ShareListener& progress) {
  std::vector<wire::CommandedJoints> items;
  items.reserve(poses.size());
  for (const CommandedJoints& pose : poses) items.push_back(to_wire(pose));
  return participant_->call_in_parts<wire::PredictError, PredictedError>(
      context, items, progress, [](wire::PredictErrorRequest & request) -> auto& { return request.poses(); },
      [](const wire::PredictErrorReply& reply) -> const auto& { return reply.predictions(); });
}

Result<Answer<CorrectedTarget>> Session::correct_targets(const CallContext& context,
                                                         const std::vector<TargetMm>& targets,
                                                         const ShareListener& progress) {
  std::vector<wire::Target> items;
  items.reserve(targets.size());
  for (const TargetMm& target : targets) items.push_back(to_wire(target));
  return participant_->call_in_parts<wire::CorrectTarget, CorrectedTarget>(
      context, items, progress, [](wire::CorrectTargetRequest & request) -> auto& { return request.targets(); },
      [](const wire::CorrectTargetReply& reply) -> const auto& { return reply.corrections(); });
}

Result<std::int64_t> Session::submit_measurements(const std::string& cell, const std::string& batch_id,
                                                  const std::string& csv) {
  if (const Status fits = check_text("batch " + batch_id, csv); !fits) return tl::make_unexpected(fits.error());
  wire::SubmitMeasurementsRequest request;
  request.change_id(make_name("change"));
  request.about().cell(cell);
  request.batch_id(batch_id);
  request.csv(csv);
  const auto reply = participant_->call<wire::SubmitMeasurements>(std::move(request), {cell, {}, true});
  if (!reply) return tl::make_unexpected(reply.error());
  return participant_->accepted(*reply);
}

Result<std::int64_t> Session::train(const std::string& cell, const std::vector<std::string>& batch_ids,
                                    const std::string& level, const std::string& bias, const ChangeOptions& change) {
  wire::TrainRequest request;
  request.about().cell(cell);
  request.change(to_wire(change));
  request.batch_ids(batch_ids);
  request.level(level);
  request.bias(bias);
  const auto reply = participant_->call<wire::Train>(std::move(request), {cell, {}, true});
  if (!reply) return tl::make_unexpected(reply.error());
  return participant_->accepted(*reply);
}

namespace {

wire::TrainRequest training_of_diagnosis(const std::string& cell, const std::string& batch_id, const std::string& csv,
                                         const ChangeOptions& change) {
  wire::TrainRequest request;
  request.about().cell(cell);
  request.change(to_wire(change));
  request.kind(wire::TRAIN_DIAGNOSED);
  if (!batch_id.empty()) request.batch_ids({batch_id});
  request.csv(csv);
  return request;
}

}  // namespace

Result<std::int64_t> Session::diagnose(const std::string& cell, const std::string& batch_id, const std::string& csv,
                                       bool apply, const ChangeOptions& change) {
  if (const Status fits = check_text("the batch", csv); !fits) return tl::make_unexpected(fits.error());
  const Route route{cell, {}, true};
  if (apply) {
    const auto reply = participant_->call<wire::Train>(training_of_diagnosis(cell, batch_id, csv, change), route);
    if (!reply) return tl::make_unexpected(reply.error());
    return participant_->accepted(*reply);
  }
  wire::DiagnoseRequest request;
  request.about().cell(cell);
  request.change_id(change_id(change));
  request.batch_id(batch_id);
  request.csv(csv);
  const auto reply = participant_->call<wire::Diagnose>(std::move(request), route);
  if (!reply) return tl::make_unexpected(reply.error());
  return participant_->accepted(*reply);
}

Result<std::int64_t> Session::check_health(const std::string& cell, const std::string& batch_id, const std::string& csv,
                                           double tolerance_mm, const ChangeOptions& change) {
  if (const Status fits = check_text("the batch", csv); !fits) return tl::make_unexpected(fits.error());
  wire::CheckHealthRequest request;
  request.about().cell(cell);
  request.change_id(change_id(change));
  request.batch_id(batch_id);
  request.csv(csv);
  request.tolerance_mm(tolerance_mm);
  const auto reply = participant_->call<wire::CheckHealth>(std::move(request), Route{cell, {}, true});
  if (!reply) return tl::make_unexpected(reply.error());
  return participant_->accepted(*reply);
}

Result<DiagnosisAnswer> Session::diagnosis(const std::string& cell, std::int64_t job, bool page) {
  const auto found = participant_->find_job(job, cell);
  if (!found) return tl::make_unexpected(found.error());
  wire::ReadModelsRequest request;
  request.job(job);
  request.page(page);
  auto reply = participant_->read(cell, found->first, wire::READ_FINDINGS, std::move(request),
                                  participant_->record_of(found->first));
  if (!reply) return tl::make_unexpected(reply.error());
  return DiagnosisAnswer{std::move(reply->text()), std::move(reply->page_html()), from_wire(reply->in_force())};
}

namespace {

std::vector<BatchOfService> batches_in(const std::vector<wire::ReadModelsReply>& replies) {
  std::vector<std::pair<wire::BatchInfo, std::string>> told;
  for (const wire::ReadModelsReply& reply : replies)
    add_new(told, reply.batches(), reply.header().server().to_string(), std::equal_to<>());
  std::vector<BatchOfService> batches;
  for (const auto& [batch, server] : told) {
    batches.push_back(from_wire(batch));
    batches.back().server = server;
  }
  return batches;
}

}  // namespace

Result<std::vector<BatchOfService>> Session::quarantine(const std::string& cell) {
  return participant_->read_all(cell, wire::READ_QUARANTINE).map(batches_in);
}

Result<std::vector<BatchOfService>> Session::batches(const std::string& cell) {
  return participant_->read_all(cell, wire::READ_BATCHES).map(batches_in);
}

Result<std::string> Session::export_batch(const std::string& cell, const std::string& batch_id) {
  wire::ReadModelsRequest request;
  request.batch_id(batch_id);
  auto reply = participant_->read(cell, {}, wire::READ_BATCH, request);
  if (!reply) return tl::make_unexpected(reply.error());
  return std::move(reply->text());
}

Status Session::release(const std::string& cell, const std::string& batch_id, const ChangeOptions& change) {
  return participant_->release(cell, {batch_id}, change, {}).map([](std::int64_t) {});
}

Status Session::discard(const std::string& cell, const std::string& batch_id, const ChangeOptions& change) {
  wire::ReleaseBatchesRequest request;
  request.action(wire::RELEASE_DISCARD);
  return participant_->release(cell, {batch_id}, change, std::move(request)).map([](std::int64_t) {});
}

Result<std::int64_t> Session::release_and_train(const std::string& cell, const std::vector<std::string>& batch_ids,
                                                const std::string& level, const std::string& bias,
                                                const ChangeOptions& change) {
  wire::ReleaseBatchesRequest request;
  request.action(wire::RELEASE_AND_TRAIN);
  request.level(level);
  request.bias(bias);
  return participant_->release(cell, batch_ids, change, std::move(request));
}

Result<std::vector<DatedJob>> Session::jobs(const std::string& cell) {
  const auto replies = participant_->read_all(cell, wire::READ_JOBS);
  if (!replies) return tl::make_unexpected(replies.error());
  std::vector<std::pair<wire::Job, std::string>> told;
  for (const wire::ReadModelsReply& reply : *replies)
    add_new(told, reply.jobs(), reply.header().server().to_string(), is_same);
  std::vector<DatedJob> jobs;
  for (const auto& [job, server] : told) jobs.push_back(from_wire(job, server));
  return jobs;
}

Result<std::vector<AuditText>> Session::audit(const std::string& cell, std::int64_t since_unix_s, std::size_t most) {
  wire::ReadModelsRequest request;
  request.since_unix_s(since_unix_s);
  request.most(static_cast<std::uint32_t>(most));
  const auto replies = participant_->read_all(cell, wire::READ_AUDIT, request);
  if (!replies) return tl::make_unexpected(replies.error());
  std::vector<AuditText> texts;
  for (const wire::ReadModelsReply& reply : *replies)
    texts.push_back({reply.header().server().to_string(), reply.text()});
  return texts;
}

Result<std::vector<std::string>> Session::fleet() {
  const auto replies = participant_->read_all("", wire::READ_FLEET);
  if (!replies) return tl::make_unexpected(replies.error());
  std::vector<std::string> texts;
  for (const wire::ReadModelsReply& reply : *replies) texts.push_back(reply.text());
  return texts;
}

Result<std::vector<std::string>> Session::health(const std::string& cell, std::size_t most) {
  wire::ReadModelsRequest request;
  request.since_unix_s(-1);
  request.most(static_cast<std::uint32_t>(most));
  const auto replies = participant_->read_all(cell, wire::READ_HEALTH, request);
  if (!replies) return tl::make_unexpected(replies.error());
  std::vector<std::string> texts;
  for (const wire::ReadModelsReply& reply : *replies) texts.push_back(reply.text());
  return texts;
}

Result<std::vector<ModelInfo>> Session::models(const std::string& cell) {
  const auto reply = participant_->read(cell, {}, wire::READ_MODELS);
  if (!reply) return tl::make_unexpected(reply.error());
  std::vector<ModelInfo> models;
  for (const wire::ModelInfo& model : reply->models()) models.push_back(from_wire(model));
  return models;
}

Result<int> Session::activate(const std::string& cell, int version, const ChangeOptions& change) {
  wire::ManageModelsRequest request;
  request.version(version);
  request.force(change.force);
  const auto reply = participant_->manage(cell, wire::MANAGE_ACTIVATE, change, std::move(request));
  if (!reply) return tl::make_unexpected(reply.error());
  return reply->version();
}

Status Session::cancel(std::int64_t job) {
  const auto found = participant_->find_job(job);
  if (!found) return tl::make_unexpected(found.error());
  wire::ManageModelsRequest request;
  request.job(job);
  return participant_->manage(found->second.cell(), wire::MANAGE_CANCEL_JOB, {}, std::move(request), found->first)
      .map([](const auto&) {});
}

Result<int> Session::rollback(const std::string& cell, const ChangeOptions& change) {
  const auto reply = participant_->manage(cell, wire::MANAGE_ROLLBACK, change);
  if (!reply) return tl::make_unexpected(reply.error());
  return reply->version();
}

Result<std::string> Session::export_model(const std::string& cell, int version) {
  wire::ReadModelsRequest request;
  request.version(version);
  auto reply = participant_->read(cell, {}, wire::READ_MODEL, std::move(request));
  if (!reply) return tl::make_unexpected(reply.error());
  return std::move(reply->text());
}

Result<std::string> Session::replay(const std::string& cell, int version) {
  wire::ReadModelsRequest request;
  request.version(version);
  auto reply = participant_->read(cell, {}, wire::READ_REPLAY, std::move(request));
  if (!reply) return tl::make_unexpected(reply.error());
  return std::move(reply->text());
}

Result<int> Session::import_model(const std::string& cell, const std::string& text, const ChangeOptions& change) {
  if (const Status fits = check_text("the model", text); !fits) return tl::make_unexpected(fits.error());
  wire::ManageModelsRequest request;
  request.model_text(text);
  const auto reply = participant_->manage(cell, wire::MANAGE_IMPORT, change, std::move(request));
  if (!reply) return tl::make_unexpected(reply.error());
  return reply->version();
}

Result<std::vector<ServerStatus>> Session::servers() {
  const auto& options = participant_->options;
  const auto known = participant_->watch->wait_for_servers(options.servers.size(), participant_->deadline());
  if (known.empty()) return tl::make_unexpected(participant_->no_server());
  std::vector<ServerStatus> servers;
  for (const KnownServer& server : known) servers.push_back(from_wire(server.status));
  return servers;
}

Result<std::vector<ServerStatus>> Session::servers_when(
    const std::function<bool(const std::vector<ServerStatus>&)>& holds, std::chrono::milliseconds limit) {
  const auto until = Clock::now() + limit;
  while (true) {
    auto known = servers();
    if (!known || holds(*known) || Clock::now() >= until) return known;
    participant_->watch->wait_until(std::min(until, Clock::now() + kLook));
  }
}

Result<std::vector<ModelInfo>> Session::model_status() {
  if (const auto known = servers(); !known) return tl::make_unexpected(known.error());
  std::vector<ModelInfo> models;
  for (const wire::ModelInfo& model : participant_->watch->models_in_force()) models.push_back(from_wire(model));
  return models;
}

Result<JobStatus> Session::wait_for_job(std::int64_t job, std::chrono::milliseconds limit,
                                        const std::function<void(const JobStatus&)>& listener) {
  const auto deadline = Clock::now() + limit;
  const auto found = participant_->find_job(job);
  if (!found) return tl::make_unexpected(found.error());
  const std::string& server = found->first;
  JobStatus status = status_of(found->second);
  std::uint64_t seen = 0;
  while (true) {
    if (listener) listener(status);
    if (is_over(status)) {
      participant_->told(job, server);
      return status;
    }
    std::optional<wire::Job> news;
    while (!news) {
      if (Clock::now() >= deadline) {
        return failure(ErrorCode::kUnreachable, "job {} is not over after {} ms: {}", job, limit.count(), status.what);
      }
      news = participant_->watch->wait_for_progress(server, job, seen, std::min(deadline, Clock::now() + kJobPoll));
      if (news) continue;
      const auto asked = participant_->job(server, job);
      const bool may_come = !asked && (asked.error().code == ErrorCode::kUnreachable ||
                                       asked.error().code == ErrorCode::kBusy);  // a record that is away
      if (!asked && !may_come) return tl::make_unexpected(asked.error());
      if (asked) news = *asked;
    }
    status = status_of(*news);
  }
}

}  // namespace trammel::client
