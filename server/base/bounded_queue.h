#pragma once

#include <cstddef>
#include <deque>
#include <optional>
#include <stop_token>
#include <utility>

#include "server/base/mutex.h"

namespace trammel {

/// A first-in-first-out queue with a limit; a full queue refuses instead of blocking the producer.
/// Thread-safe.
template <typename T>
class BoundedQueue {
 public:
  explicit BoundedQueue(std::size_t capacity) : capacity_(capacity) {}

  /// False when the queue is full; the item is then untouched.
  [[nodiscard]] bool try_push(T&& item) {
    {
      const MutexLock lock(mutex_);
      if (items_.size() >= capacity_) return false;
      items_.push_back(std::move(item));
    }
    ready_.notify_one();
    return true;
  }

  /// Waits for an item; empty once `stop` is requested (items still queued stay queued).
  [[nodiscard]] std::optional<T> pop(const std::stop_token& stop) {
    MutexLock lock(mutex_);
    if (!ready_.wait(lock, stop, [this]() TRAMMEL_REQUIRES(mutex_) { return !items_.empty(); }) ||
        stop.stop_requested())
      return std::nullopt;
    T item = std::move(items_.front());
    items_.pop_front();
    return item;
  }

  [[nodiscard]] std::size_t size() const {
    const MutexLock lock(mutex_);
    return items_.size();
  }

 private:
  const std::size_t capacity_;
  mutable Mutex mutex_;
  Condition ready_;  // there are items
  std::deque<T> items_ TRAMMEL_GUARDED_BY(mutex_);
};

}  // namespace trammel
