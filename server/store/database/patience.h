#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>

namespace trammel {

/// How long calls may wait for a database: as long as each of them may, until the process is to
/// end; then for kInTheEnd at most, all together. Thread-safe.
class Patience {
 public:
  using Clock = std::chrono::steady_clock;
  /// An orderly stop may take 10 s.
  static constexpr std::chrono::seconds kInTheEnd{4};

  /// The process is to end. Calls under way hear of it.
  void ends() { last_ = std::min(last_.load(), Clock::now() + kInTheEnd); }
  /// The time until which a call with that deadline may wait.
  [[nodiscard]] Clock::time_point limited(Clock::time_point deadline) const {
    return std::min(deadline, last_.load());
  }
  [[nodiscard]] bool is_over() const { return Clock::now() >= last_.load(); }

 private:
  std::atomic<Clock::time_point> last_{Clock::time_point::max()};
};

}  // namespace trammel
