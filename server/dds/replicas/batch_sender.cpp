#include "server/dds/replicas/batch_sender.h"

#include <pthread.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "server/dds/codec.h"

namespace trammel {
namespace {

constexpr std::chrono::milliseconds kLook{250};  // at what the store has changed
constexpr std::chrono::seconds kLastWait{1};     // of a server that stops
constexpr std::chrono::seconds kTryAgain{5};     // with a follower that did not say that it has a batch

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
  copy.accepted_at_unix_s(batch.accepted_at);
  return copy;
}

/// Empty where it was pruned or is damaged: what became of it is told all the same.
std::string text_of(const Store& store, const StoredBatch& batch) {
  auto whole = store.batch(batch.cell, batch.id);
  return whole ? std::move(whole->csv) : std::string();
}

/// What another server's answer means here.
Status outcome_of(const wire::BatchCopied& answer) {
  switch (answer.result()) {
    case wire::RESULT_OK:
      return {};
    case wire::RESULT_NOT_FOUND:
      return failure(ErrorCode::kNotFound, "{}", answer.why());
    case wire::RESULT_BUSY:
      return failure(ErrorCode::kBusy, "{}", answer.why());
    case wire::RESULT_INTERNAL:
      return failure(ErrorCode::kInternal, "{}", answer.why());
    default:
      return failure(ErrorCode::kRefused, "{}", answer.why());
  }
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

void BatchSender::start(Send send) {
  {
    const MutexLock sending(sending_);
    send_ = std::move(send);
  }
  thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
}

void BatchSender::stop() {
  copies_.close(BatchCopies::Time::clock::now() + kLastWait);
  thread_.request_stop();
  if (thread_.joinable()) thread_.join();
}

void BatchSender::set_options(const ReplicaOptions& options) {
  const MutexLock lock(mutex_);
  options_ = options;
  look_again_ = true;
}

void BatchSender::set_writes(bool writes) {
  if (writes) copies_.doubt();
  const MutexLock lock(mutex_);
  writes_ = writes;
  look_again_ = true;
}

bool BatchSender::sends() const {
  const MutexLock lock(mutex_);
  return writes_ && options_.batches_to_followers;
}

void BatchSender::look_again() {
  {
    const MutexLock lock(mutex_);
    look_again_ = true;
  }
  changed_.notify_all();
}

void BatchSender::look_again(const std::string& participant) {
  copies_.doubt(participant);
  look_again();
}

void BatchSender::answered(const std::string& participant, const wire::BatchCopied& answer) {
  copies_.answered(participant, answer.number(), outcome_of(answer));
}

void BatchSender::bring(const std::string& cell, const std::string& batch_id) {
  if (!sends()) return;
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
                                                const StoredBatch& seen) {
  if (!sends()) return {};
  std::map<std::string, BatchCopies::Key> told;
  for (const auto& [follower, participant] : followers) told[follower] = {participant, seen.cell, seen.id};
  tell(told, seen);
  std::chrono::duration<double> patience{};
  {
    const MutexLock lock(mutex_);
    patience = std::chrono::duration<double>(options_.copy_timeout_s);
  }
  const auto until =
      BatchCopies::Time::clock::now() + std::chrono::duration_cast<BatchCopies::Time::duration>(patience);
  std::map<std::string, Error> wrong = copies_.wait(told, until);
  // Nobody lacks what nobody has any more.
  if (seen.pruned) std::erase_if(wrong, [](const auto& one) { return one.second.code == ErrorCode::kNotFound; });
  return wrong;
}

void BatchSender::tell(const std::map<std::string, BatchCopies::Key>& followers, const StoredBatch& seen) {
  const MutexLock sending(sending_);
  const bool all_have_it =
      std::all_of(followers.begin(), followers.end(), [&, standing = standing_of(seen)](auto& one) {
        return copies_.lacks(one.second, standing) == BatchCopies::Lacks::kNothing;
      });
  if (all_have_it) return;
  if (const auto batch = store_.batch_record(seen.cell, seen.id)) send_to(followers, *batch);
}

void BatchSender::send_to(const std::map<std::string, BatchCopies::Key>& followers, const StoredBatch& batch) {
  const std::string standing = standing_of(batch);
  std::optional<std::string> text;
  wire::BatchCopy copy = copy_of(batch);
  copy.server(server_);
  for (const auto& [follower, key] : followers) {
    const BatchCopies::Lacks lacks = copies_.lacks(key, standing);
    if (lacks == BatchCopies::Lacks::kNothing) continue;
    const bool lacks_text = lacks == BatchCopies::Lacks::kText;
    if (lacks_text && !text) text = text_of(store_, batch);
    copy.to(follower);
    copy.number(copies_.tell(key, standing));
    copy.csv(lacks_text ? *text : std::string());
    send_(copy);
  }
}

void BatchSender::run(const std::stop_token& stop) {
  ::pthread_setname_np(::pthread_self(), "batch copies");
  std::int64_t seen = -1;  // changes of the store
  constexpr auto kNever = BatchCopies::Time::max();
  auto try_again = kNever;
  while (!stop.stop_requested()) {
    const std::int64_t changes = store_.changes_made().value_or(seen);
    const bool is_due = BatchCopies::Time::clock::now() >= try_again;
    const bool sends_now = sends();
    bool look = false;
    {
      const MutexLock lock(mutex_);
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
  std::set<std::string> participants, left_out;  // left out: for this round
  for (const auto& [cell, description] : trainer_.cells()) {
    std::map<std::string, std::string> followers = followers_(cell);
    for (const auto& [follower, participant] : followers) participants.insert(participant);
    std::erase_if(followers, [&](const auto& follower) { return left_out.contains(follower.first); });
    if (followers.empty()) continue;
    for (const StoredBatch& batch : store_.batches(cell).value_or(std::vector<StoredBatch>())) {
      if (stop.stop_requested()) return missing;
      for (const auto& [follower, why] : bring(followers, batch)) {
        missing.why.try_emplace(follower, sentence(why));
        missing.try_again = missing.try_again || passes(why);
        // Silent, or its disk is full: that holds for all. What it refuses keeps none of the others from it.
        if (why.code != ErrorCode::kUnreachable && why.code != ErrorCode::kBusy) continue;
        left_out.insert(follower);
        followers.erase(follower);
      }
    }
  }
  copies_.forget_all_but(participants);
  return missing;
}

}  // namespace trammel
