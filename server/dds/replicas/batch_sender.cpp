#include "server/dds/replicas/batch_sender.h"

#include <pthread.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "server/dds/codec.h"

namespace trammel {
namespace {

constexpr std::chrono::milliseconds kLook{250};  // at what the store has changed
constexpr std::chrono::seconds kTryAgain{5};     // with a follower that did not say that it has a batch
constexpr std::size_t kRemembered = 100'000;     // answers; then all are asked once more

/// All of what a follower is told of a batch beside its text.
std::string standing_of(const StoredBatch& batch) {
  return fmt::format("{} {} {} {} {}", batch.hash, batch.discarded, batch.learned, batch.quarantine, batch.outcome);
}

wire::BatchCopy copy_of(const StoredBatch& batch) {
  wire::BatchCopy copy;
  copy.cell(batch.cell);
  copy.batch_id(batch.id);
  copy.hash(batch.hash);
  copy.quarantine(cut(batch.quarantine, wire::MAX_SENTENCE));
  copy.discarded(batch.discarded);
  copy.learned(batch.learned);
  copy.outcome(cut(batch.outcome, wire::MAX_SENTENCE));
  return copy;
}

}  // namespace

BatchSender::BatchSender(std::string server, const ReplicaOptions& options, const Trainer& trainer, const Store& store,
                         Followers followers, Trouble trouble, ReplicaListener listener)
    : server_(std::move(server)),
      trainer_(trainer),
      store_(store),
      followers_(std::move(followers)),
      trouble_(std::move(trouble)),
      listener_(std::move(listener)),
      options_(options) {}

BatchSender::~BatchSender() { stop(); }

void BatchSender::start(wire::dds::DataWriter& writer) {
  {
    const MutexLock lock(mutex_);
    writer_ = &writer;
  }
  thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
}

void BatchSender::stop() {
  thread_.request_stop();
  if (thread_.joinable()) thread_.join();
}

void BatchSender::set_options(const ReplicaOptions& options) {
  const MutexLock lock(mutex_);
  options_ = options;
  look_again_ = true;
}

void BatchSender::set_writes(bool writes) {
  const MutexLock lock(mutex_);
  writes_ = writes;
  look_again_ = true;
}

void BatchSender::look_again() {
  {
    const MutexLock lock(mutex_);
    look_again_ = true;
  }
  changed_.notify_all();
}

void BatchSender::bring(const std::string& cell, const std::string& batch_id) {
  {
    const MutexLock lock(mutex_);
    if (!sends()) return;
  }
  const auto batch = store_.batch_record(cell, batch_id);
  if (!batch) return;  // the thread finds it, where it is there
  const std::map<std::string, Error> wrong = bring(followers_(cell), *batch);
  for (const auto& [follower, why] : wrong) {
    if (listener_)
      listener_({"replica_batch_not_copied", fmt::format("batch {} of cell {} is not on {} as it is on {} yet: {}",
                                                         batch_id, cell, follower, server_, sentence(why))});
  }
  if (!wrong.empty()) look_again();
}

std::map<std::string, Error> BatchSender::bring(const std::map<std::string, std::string>& followers,
                                                const StoredBatch& batch) {
  const std::string standing = standing_of(batch);
  std::map<std::string, Error> wrong;
  std::map<std::string, bool> have_text;  // of those that are to be told
  std::chrono::duration<double> patience{};
  wire::dds::DataWriter* writer = nullptr;
  {
    const MutexLock lock(mutex_);
    writer = writer_;
    if (said_.size() > kRemembered) said_.clear();
    patience = std::chrono::duration<double>(options_.copy_timeout_s);
    for (const auto& [follower, participant] : followers) {
      const auto said = said_.find({participant, batch.cell, batch.id});
      const bool has_text = said != said_.end() && !said->second.refused;
      if (said == said_.end() || said->second.standing != standing) {
        have_text[follower] = has_text;
      } else if (said->second.refused) {
        wrong[follower] = *said->second.refused;
      }
    }
  }
  if (have_text.empty()) return wrong;

  const auto lacks_text = [](const auto& follower) { return !follower.second; };
  std::string text;
  if (!batch.pruned && std::any_of(have_text.begin(), have_text.end(), lacks_text)) {
    auto stored = store_.batch(batch.cell, batch.id);
    if (stored) text = std::move(stored->csv);
    if (!stored) std::erase_if(have_text, lacks_text);  // a text that cannot be read is said elsewhere
  }
  wire::BatchCopy copy = copy_of(batch);
  copy.server(server_);
  std::vector<std::string> told;
  for (const auto& [follower, has_text] : have_text) told.push_back(follower);
  const auto numbers = copies_.expect(told);
  for (const auto& [follower, number] : numbers) {
    copy.to(follower);
    copy.number(number);
    copy.csv(have_text.at(follower) ? std::string() : text);
    writer->write(&copy);
  }
  const auto until =
      BatchCopies::Time::clock::now() + std::chrono::duration_cast<BatchCopies::Time::duration>(patience);
  std::map<std::string, Error> answers = copies_.wait(numbers, until);
  const MutexLock lock(mutex_);
  for (const std::string& follower : told) {
    const auto answer = answers.find(follower);
    const bool has_taken = answer == answers.end() || (batch.pruned && answer->second.code == ErrorCode::kNotFound);
    if (!has_taken) wrong[follower] = answer->second;
    if (!has_taken && answer->second.code == ErrorCode::kUnreachable) continue;
    said_[{followers.at(follower), batch.cell, batch.id}] = {standing,
                                                             has_taken ? std::nullopt : std::optional(answer->second)};
  }
  return wrong;
}

void BatchSender::run(const std::stop_token& stop) {
  ::pthread_setname_np(::pthread_self(), "batch copies");
  std::int64_t seen = -1;  // changes of the store
  constexpr auto kNever = BatchCopies::Time::max();
  auto try_again = kNever;
  while (!stop.stop_requested()) {
    const std::int64_t changes = store_.changes_made().value_or(seen);
    const bool is_due = BatchCopies::Time::clock::now() >= try_again;
    bool sends_now = false, look = false;
    {
      const MutexLock lock(mutex_);
      sends_now = sends();
      look = sends_now && (changes != seen || is_due || look_again_);
      look_again_ = false;
    }
    if (look) {
      const Missing missing = bring_all(stop);
      seen = changes;
      try_again = missing.try_again ? BatchCopies::Time::clock::now() + kTryAgain : kNever;
      std::string all;
      for (const auto& [follower, why] : missing.why)
        all += fmt::format("{}{} may lack batches that {} has: {}", all.empty() ? "" : "; ", follower, server_, why);
      trouble_(all);
    } else if (!sends_now) {
      seen = -1;
      trouble_("");
    }
    MutexLock lock(mutex_);
    changed_.wait_for(lock, stop, kLook, [this]() TRAMMEL_REQUIRES(mutex_) { return look_again_; });
  }
}

BatchSender::Missing BatchSender::bring_all(const std::stop_token& stop) {
  Missing missing;
  std::set<std::string> silent;
  for (const auto& [cell, description] : trainer_.cells()) {
    std::map<std::string, std::string> followers = followers_(cell);
    std::erase_if(followers, [&](const auto& follower) { return silent.contains(follower.first); });
    if (followers.empty()) continue;
    for (const StoredBatch& batch : store_.batches(cell).value_or(std::vector<StoredBatch>())) {
      if (stop.stop_requested()) return missing;
      for (const auto& [follower, why] : bring(followers, batch)) {
        missing.why.try_emplace(follower, sentence(why));
        if (why.code != ErrorCode::kUnreachable) continue;  // what it refuses keeps none of the others from it
        silent.insert(follower);
        followers.erase(follower);
        missing.try_again = true;
      }
    }
  }
  return missing;
}

}  // namespace trammel
