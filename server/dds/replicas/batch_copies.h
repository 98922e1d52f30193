#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "server/base/mutex.h"
#include "server/base/result.h"

namespace trammel {

/// Copies of batches that were sent to followers and are not answered yet. No DDS. Thread-safe.
class BatchCopies {
 public:
  using Time = std::chrono::steady_clock::time_point;

  /// The numbers of copies to so many followers: from now on their answers are waited for.
  [[nodiscard]] std::map<std::string, std::uint64_t> expect(const std::vector<std::string>& followers);
  /// A follower's answer; nothing happens where nobody waits for it from that one.
  void answered(const std::string& follower, std::uint64_t number, const Status& outcome);
  /// Waits for all of them; what is wrong by follower, nothing where the batch is there. Call it once.
  [[nodiscard]] std::map<std::string, Error> wait(const std::map<std::string, std::uint64_t>& numbers, Time until);

 private:
  struct Awaited {
    std::string from;
    std::optional<Status> outcome;  // empty: no answer yet
  };

  Mutex mutex_;
  Condition changed_;
  std::uint64_t last_ TRAMMEL_GUARDED_BY(mutex_) = 0;
  std::map<std::uint64_t, Awaited> waiting_ TRAMMEL_GUARDED_BY(mutex_);
};

}  // namespace trammel
