#pragma once

#include <chrono>
#include <cstddef>
#include <map>
#include <memory>
#include <string>

#include "server/base/mutex.h"
#include "server/dds/reply_sink.h"

namespace trammel {

/// Hands replies to threads of this process that wait for them. A reply that nobody waits for any
/// longer is dropped. Thread-safe.
class WaitingReplies final : public ReplySink {
 public:
  using Clock = std::chrono::steady_clock;

  void send(const ReplyAddress& to, std::shared_ptr<void> reply, std::size_t bytes) override;
  void post(const ReplyAddress& to, std::shared_ptr<void> reply, std::size_t bytes) override;

  /// From now on a reply to this partition is kept. Call it before the request is queued.
  void expect(const std::string& partition);
  /// The reply; null when `until` is over, or after close().
  [[nodiscard]] std::shared_ptr<void> wait(const std::string& partition, Clock::time_point until);
  /// Nobody waits any longer.
  void close();

 private:
  Mutex mutex_;
  Condition came_;
  std::map<std::string, std::shared_ptr<void>> expected_
      TRAMMEL_GUARDED_BY(mutex_);  // null: not yet
  bool closed_ TRAMMEL_GUARDED_BY(mutex_) = false;
};

}  // namespace trammel
