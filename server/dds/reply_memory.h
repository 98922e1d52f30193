#pragma once

#include <cstddef>
#include <deque>
#include <optional>
#include <string>
#include <unordered_map>
#include <utility>

#include "idl/repairs/safe_type.h"
#include "server/base/mutex.h"

namespace trammel {

/// The last replies by request id. A repeat of a request gets the same reply and is not carried out
/// again. Thread-safe.
template <typename Reply>
class ReplyMemory {
 public:
  struct Kept {
    wire::ContentId asked;  ///< the content of the request under this id
    Reply reply;
  };
  explicit ReplyMemory(std::size_t capacity) : capacity_(capacity) {}

  [[nodiscard]] std::optional<Kept> find(const std::string& request_id) const {
    const MutexLock lock(mutex_);
    const auto found = replies_.find(request_id);
    if (found == replies_.end()) return std::nullopt;
    return found->second;
  }

  void remember(const std::string& request_id, const wire::ContentId& asked, Reply reply) {
    const MutexLock lock(mutex_);
    if (!replies_.emplace(request_id, Kept{asked, std::move(reply)}).second) return;
    order_.push_back(request_id);
    if (order_.size() > capacity_) {
      replies_.erase(order_.front());
      order_.pop_front();
    }
  }

 private:
  const std::size_t capacity_;
  mutable Mutex mutex_;
  std::unordered_map<std::string, Kept> replies_ TRAMMEL_GUARDED_BY(mutex_);
  std::deque<std::string> order_ TRAMMEL_GUARDED_BY(mutex_);  // oldest first
};

/// The requests that are being answered. A repeat of one is not carried out again: the same answer
/// is sent once more. Thread-safe.
class UnderWay {
  enum class Stand { kFirst, kRepeat, kOther };

 public:
  /// One request while it is being answered.
  class Piece {
   public:
    Piece(UnderWay& all, std::string request, const wire::ContentId& asked)
        : all_(all), request_(std::move(request)), stand_(all.begin(request_, asked)) {}
    ~Piece() {
      if (is_first()) all_.end(request_);
    }
    Piece(const Piece&) = delete;
    Piece& operator=(const Piece&) = delete;
    /// False: the request is being answered already, and the answer will be sent again for this
    /// repeat.
    [[nodiscard]] bool is_first() const { return stand_ == Stand::kFirst; }
    /// True if another request is being answered under the same id.
    [[nodiscard]] bool is_other() const { return stand_ == Stand::kOther; }
    /// For the first request: true if a repeat without an answer has come; it then counts as
    /// answered. After false no more repeats are accepted.
    [[nodiscard]] bool has_repeat() { return all_.take_repeat(request_); }

   private:
    UnderWay& all_;
    const std::string request_;
    const Stand stand_;
  };

 private:
  struct First {
    wire::ContentId asked;
    int repeats = 0;
  };

  [[nodiscard]] Stand begin(const std::string& request, const wire::ContentId& asked) {
    const MutexLock lock(mutex_);
    const auto [entry, is_first] = under_way_.try_emplace(request, First{asked});
    if (is_first) return Stand::kFirst;
    if (asked.is_other_than(entry->second.asked)) return Stand::kOther;
    ++entry->second.repeats;
    return Stand::kRepeat;
  }
  [[nodiscard]] bool take_repeat(const std::string& request) {
    const MutexLock lock(mutex_);
    const auto entry = under_way_.find(request);
    if (entry == under_way_.end()) return false;
    if (entry->second.repeats-- > 0) return true;
    under_way_.erase(entry);
    return false;
  }
  void end(const std::string& request) {
    const MutexLock lock(mutex_);
    under_way_.erase(request);
  }

  Mutex mutex_;
  std::unordered_map<std::string, First> under_way_ TRAMMEL_GUARDED_BY(mutex_);  // by request
};

}  // namespace trammel
