#pragma once

#include <memory>
#include <stop_token>
#include <utility>
#include <vector>

#include "server/base/mutex.h"

namespace trammel {

/// Frees values in a thread of its own, so that the owner of the last pointer to a large value does
/// not pay for freeing it. Without that thread the last owner frees it. Thread-safe.
template <typename Value>
class Reclaimer : public std::enable_shared_from_this<Reclaimer<Value>> {
 public:
  [[nodiscard]] std::shared_ptr<const Value> watch(Value value) {
    auto owned = std::make_unique<const Value>(std::move(value));
    return {owned.release(), [self = this->shared_from_this()](const Value* last) {
              self->bury(std::unique_ptr<const Value>(last));
            }};
  }
  /// Frees the released values until `stop` is requested.
  void run(const std::stop_token& stop) {
    {
      const MutexLock lock(mutex_);
      runs_ = true;
    }
    for (;;) {
      std::vector<std::unique_ptr<const Value>> dead;
      MutexLock lock(mutex_);
      const bool some =
          came_.wait(lock, stop, [this]() TRAMMEL_REQUIRES(mutex_) { return !dead_.empty(); });
      dead.swap(dead_);
      if (!some) runs_ = false;
      lock.unlock();
      if (!some) return;
    }
  }

 private:
  void bury(std::unique_ptr<const Value> last) {
    {
      const MutexLock lock(mutex_);
      if (!runs_) return;  // freed here, without the lock
      dead_.push_back(std::move(last));
    }
    came_.notify_one();
  }

  Mutex mutex_;
  Condition came_;
  bool runs_ TRAMMEL_GUARDED_BY(mutex_) = false;
  std::vector<std::unique_ptr<const Value>> dead_ TRAMMEL_GUARDED_BY(mutex_);
};

}  // namespace trammel
