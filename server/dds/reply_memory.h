#pragma once

#include <cstddef>
#include <deque>
#include <optional>
#include <string>
#include <unordered_map>
#include <utility>

#include "server/base/mutex.h"

namespace trammel {

/// The last replies by request id. A repeat of a request gets the same reply and is not carried out again. Thread-safe.
template <typename Reply>
class ReplyMemory {
 public:
  explicit ReplyMemory(std::size_t capacity) : capacity_(capacity) {}

  [[nodiscard]] std::optional<Reply> find(const std::string& request_id) const {
    const MutexLock lock(mutex_);
    const auto found = replies_.find(request_id);
    if (found == replies_.end()) return std::nullopt;
    return found->second;
  }

  void remember(const std::string& request_id, Reply reply) {
    const MutexLock lock(mutex_);
    if (!replies_.emplace(request_id, std::move(reply)).second) return;
    order_.push_back(request_id);
    if (order_.size() > capacity_) {
      replies_.erase(order_.front());
      order_.pop_front();
    }
  }

 private:
  const std::size_t capacity_;
  mutable Mutex mutex_;
  std::unordered_map<std::string, Reply> replies_ TRAMMEL_GUARDED_BY(mutex_);
  std::deque<std::string> order_ TRAMMEL_GUARDED_BY(mutex_);  // oldest first
};

/// The requests that are being answered, so that a repeat is not carried out beside them: it gets the same answer once
/// more. Thread-safe.
class UnderWay {
 public:
  /// One request while it is being answered.
  class Piece {
   public:
    Piece(UnderWay& all, std::string request)
        : all_(all), request_(std::move(request)), is_first_(all.begin(request_)) {}
    ~Piece() {
      if (is_first_) all_.end(request_);
    }
    Piece(const Piece&) = delete;
    Piece& operator=(const Piece&) = delete;
    /// False: it is being answered already, and will be once more for this repeat.
    [[nodiscard]] bool is_first() const { return is_first_; }
    /// Of the first: whether a repeat has come that has no answer yet; it counts as answered then. False is the end.
    [[nodiscard]] bool has_repeat() { return all_.take_repeat(request_); }

   private:
    UnderWay& all_;
    const std::string request_;
    const bool is_first_;
  };

 private:
  [[nodiscard]] bool begin(const std::string& request) {
    const MutexLock lock(mutex_);
    const auto [entry, is_first] = repeats_.try_emplace(request, 0);
    if (!is_first) ++entry->second;
    return is_first;
  }
  [[nodiscard]] bool take_repeat(const std::string& request) {
    const MutexLock lock(mutex_);
    const auto entry = repeats_.find(request);
    if (entry == repeats_.end()) return false;
    if (entry->second-- > 0) return true;
    repeats_.erase(entry);
    return false;
  }
  void end(const std::string& request) {
    const MutexLock lock(mutex_);
    repeats_.erase(request);
  }

  Mutex mutex_;
  std::unordered_map<std::string, int> repeats_ TRAMMEL_GUARDED_BY(mutex_);  // by request
};

}  // namespace trammel
