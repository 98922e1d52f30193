#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <span>

namespace trammel {

/// The processor times of a thread since its beginning.
struct ThreadTimes {
  int id = 0;
  std::uint64_t ran = 0,
                queued = 0;  ///< ns; queued: it could run, and another one had the processor
};

/// The share of the processor time that a process wanted and got, from the times of its threads
/// before and after `passed`: the lesser of that of all of them together, and of that of the one
/// that waited longest. A thread that waits for a lock, or for news, wants no processor.
[[nodiscard]] double processor_share(std::span<const ThreadTimes> before,
                                     std::span<const ThreadTimes> after,
                                     std::chrono::nanoseconds passed);

/// The time that this process lived through and was given a processor in. What does not move
/// meanwhile hangs; what does not move while the process is stopped, or while the machine is
/// crowded, need not. Uses no heap and no lock, so that a watching thread may call it. Not
/// thread-safe.
class LivedTime {
 public:
  using Milliseconds = std::chrono::milliseconds;
  static constexpr double kLeast = 0.25;  ///< so that what hangs on a crowded machine is noticed

  /// since_last() is called every `tick`.
  explicit LivedTime(Milliseconds tick);

  /// Since the last call: a tick at most, since a look comes late where nobody ran. The whole of
  /// it counts if the system does not report times.
  [[nodiscard]] Milliseconds since_last();

 private:
  static constexpr std::size_t kMostThreads = 1024;  // the times of others are left out
  using Clock = std::chrono::steady_clock;
  struct Threads {
    std::array<ThreadTimes, kMostThreads> times;
    std::size_t count = 0;
  };
  static void read(Threads& threads);

  const Milliseconds tick_;
  Clock::time_point last_ = Clock::now();
  Threads before_, after_;
};

}  // namespace trammel
