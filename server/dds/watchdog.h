#pragma once

#include <chrono>
#include <functional>
#include <thread>
#include <vector>

#include "server/dds/stillness.h"

namespace trammel {

/// Exit code of a process that ends because it hangs: another start may go well.
inline constexpr int kExitHung = 70;

/// Writes `line` to standard error if that can be done without waiting, and ends the process at once: no destructor
/// runs and no lock is taken, because what hangs may hold any of them.
[[noreturn]] void end_at_once(const char* line);

/// Ends the process when one of `parts` stops moving: a daemon that hangs is mute for ever, one that ends is started
/// again. Looks from a thread of its own until it is destroyed.
class Watchdog {
 public:
  static constexpr std::chrono::milliseconds kTick{250};
  static constexpr std::chrono::milliseconds kLimit{5000};

  explicit Watchdog(std::vector<MovingPart> parts);

 private:
  void watch(const std::stop_token& stop);

  Stillness stillness_;
  std::jthread thread_;
};

}  // namespace trammel
