#pragma once

#include <chrono>
#include <functional>
#include <thread>
#include <vector>

#include "server/dds/processor_share.h"
#include "server/dds/stillness.h"

namespace trammel {

/// Exit code of a process that ends because it hangs. A restart may help.
inline constexpr int kExitHung = 70;

/// Writes `line` to standard error if that needs no waiting, and ends the process at once. Runs no destructor and takes
/// no lock: the thread that hangs may hold any lock.
[[noreturn]] void end_at_once(const char* line);

/// Ends the process when one of `parts` stops moving. Time counts only as far as the process was given the processor:
/// one that is slow on a crowded machine does not hang. A daemon that has ended is started again by its supervisor; one
/// that hangs is not. Checks from its own thread until it is destroyed.
class Watchdog {
 public:
  static constexpr std::chrono::milliseconds kTick{250};
  static constexpr std::chrono::milliseconds kLimit{2500};  ///< the slowest part moves once a second

  explicit Watchdog(std::vector<MovingPart> parts);

 private:
  void watch(const std::stop_token& stop);

  Stillness stillness_;
  ProcessorShare given_;
  std::jthread thread_;
};

}  // namespace trammel
