#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <string>
#include <thread>
#include <vector>

#include "server/base/lived_time.h"
#include "server/dds/stillness.h"

namespace trammel {

/// Exit code of a process that hangs. A restart may help.
inline constexpr int kExitHung = 70;

/// Writes `line` to standard error if that is possible without waiting, and ends the process at
/// once. Runs no destructor and takes no lock: the thread that hangs may hold any lock.
[[noreturn]] void end_at_once(const char* line);

/// Ends the process when one of `parts` stops moving. Time counts only while the process had a
/// processor: a process that is slow on a crowded machine does not hang. A supervisor restarts a
/// daemon that has ended, but not one that hangs. Checks from its own thread until it is destroyed.
class Watchdog {
 public:
  static constexpr std::chrono::milliseconds kTick{250};
  static constexpr std::chrono::milliseconds kLimit{
      2500};  ///< the slowest part moves once a second

  static constexpr std::chrono::milliseconds kLong{
      1750};  ///< without a movement: told, within two periods of a second

  explicit Watchdog(std::vector<MovingPart> parts);

  /// The parts that have not moved for kLong; `watchdog` if the watchdog itself has not looked for
  /// as long. Takes no lock.
  [[nodiscard]] std::vector<std::string> still() const;

 private:
  void watch(const std::stop_token& stop);

  const std::vector<MovingPart> parts_;
  Stillness stillness_;
  std::atomic<std::uint64_t> still_{0};  // as Stillness::still_for()
  std::atomic<std::chrono::steady_clock::duration> looked_{
      std::chrono::steady_clock::now().time_since_epoch()};
  LivedTime lived_{kTick};
  std::jthread thread_;
};

}  // namespace trammel
