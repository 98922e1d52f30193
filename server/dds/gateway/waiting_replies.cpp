#include "server/dds/gateway/waiting_replies.h"

#include <utility>

namespace trammel {

void WaitingReplies::send(const ReplyAddress& to, std::shared_ptr<void> reply, std::size_t) {
  {
    const MutexLock lock(mutex_);
    const auto found = expected_.find(to.partition);
    if (found == expected_.end()) return;
    found->second = std::move(reply);
  }
  came_.notify_all();
}

void WaitingReplies::post(const ReplyAddress& to, std::shared_ptr<void> reply, std::size_t bytes) {
  send(to, std::move(reply), bytes);
}

void WaitingReplies::expect(const std::string& partition) {
  const MutexLock lock(mutex_);
  expected_[partition] = nullptr;
}

std::shared_ptr<void> WaitingReplies::wait(const std::string& partition, Clock::time_point until) {
  MutexLock lock(mutex_);
  came_.wait_until(lock, until, [&]() TRAMMEL_REQUIRES(mutex_) {
    return expected_[partition] != nullptr || closed_;
  });
  std::shared_ptr<void> came = std::move(expected_[partition]);
  expected_.erase(partition);
  return came;
}

void WaitingReplies::close() {
  {
    const MutexLock lock(mutex_);
    closed_ = true;
  }
  came_.notify_all();
}

}  // namespace trammel
