#include "server/trainer/job_queue.h"

#include <algorithm>
#include <utility>

namespace trammel {

void JobQueue::push(WaitingJob job) {
  {
    const MutexLock lock(mutex_);
    waiting_[job.cell].push_back(std::move(job));
  }
  ready_.notify_one();
}

void JobQueue::push_front(WaitingJob job) {
  {
    const MutexLock lock(mutex_);
    waiting_[job.cell].push_front(std::move(job));
  }
  ready_.notify_one();
}

void JobQueue::hold(bool held) {
  {
    const MutexLock lock(mutex_);
    held_ = held;
  }
  ready_.notify_one();
}

std::optional<TakenJob> JobQueue::take(const std::stop_token& stop) {
  MutexLock lock(mutex_);
  if (!ready_.wait(lock, stop,
                   [this]() TRAMMEL_REQUIRES(mutex_) { return !waiting_.empty() && !held_; }) ||
      stop.stop_requested())
    return std::nullopt;
  WaitingJob job = next();
  taken_ = job.id;
  cancelling_ = {};
  cancelled_by_.clear();
  return TakenJob{std::move(job), cancelling_.get_token()};
}

WaitingJob JobQueue::next() {
  auto turn = waiting_.upper_bound(last_cell_);
  if (turn == waiting_.end()) turn = waiting_.begin();
  last_cell_ = turn->first;
  WaitingJob job = std::move(turn->second.front());
  turn->second.pop_front();
  if (turn->second.empty()) waiting_.erase(turn);
  return job;
}

void JobQueue::put_down() {
  const MutexLock lock(mutex_);
  taken_.reset();
}

JobQueue::Cancelled JobQueue::cancel(std::int64_t id, const std::string& who) {
  std::stop_source source;
  {
    const MutexLock lock(mutex_);
    if (is_removed(id)) return Cancelled::kRemoved;
    if (taken_ != id) return Cancelled::kUnknown;
    source = cancelling_;
    if (!source.stop_requested()) cancelled_by_ = who;  // the first one counts
  }
  source.request_stop();
  return Cancelled::kStopping;
}

std::string JobQueue::cancelled_by() const {
  const MutexLock lock(mutex_);
  return cancelled_by_;
}

bool JobQueue::remove(std::int64_t id) {
  const MutexLock lock(mutex_);
  return is_removed(id);
}

void JobQueue::remove_cell(const std::string& cell) {
  const MutexLock lock(mutex_);
  waiting_.erase(cell);
}

bool JobQueue::is_removed(std::int64_t id) {
  for (auto cell = waiting_.begin(); cell != waiting_.end(); ++cell) {
    if (std::erase_if(cell->second, [id](const WaitingJob& job) { return job.id == id; }) == 0)
      continue;
    if (cell->second.empty()) waiting_.erase(cell);
    return true;
  }
  return false;
}

std::set<std::int64_t> JobQueue::jobs() const {
  const MutexLock lock(mutex_);
  std::set<std::int64_t> ids;
  for (const auto& [cell, waiting] : waiting_) {
    for (const WaitingJob& job : waiting) ids.insert(job.id);
  }
  if (taken_) ids.insert(*taken_);
  return ids;
}

std::size_t JobQueue::size() const {
  const MutexLock lock(mutex_);
  std::size_t jobs = 0;
  for (const auto& [cell, waiting] : waiting_) jobs += waiting.size();
  return jobs;
}

std::size_t JobQueue::asked_for(const std::string& cell) const {
  const MutexLock lock(mutex_);
  const auto found = waiting_.find(cell);
  if (found == waiting_.end()) return 0;
  return static_cast<std::size_t>(
      std::count_if(found->second.begin(), found->second.end(),
                    [](const WaitingJob& job) { return job.asked_for; }));
}

}  // namespace trammel
