#include "server/store/clock_watch.h"

#include <ctime>

namespace trammel {

ClockWatch::Time ClockWatch::now() {
  using std::chrono::duration_cast;
  using std::chrono::milliseconds;
  timespec time{};
  ::clock_gettime(CLOCK_BOOTTIME, &time);  // goes on while the host is suspended
  const auto since_boot =
      std::chrono::seconds(time.tv_sec) + std::chrono::nanoseconds(time.tv_nsec);
  return {duration_cast<milliseconds>(std::chrono::system_clock::now().time_since_epoch()),
          duration_cast<milliseconds>(since_boot)};
}

std::optional<std::chrono::seconds> ClockWatch::look(Time now) {
  const std::chrono::milliseconds step = shift(now) - last_;
  if (std::chrono::abs(step) < kNoticed) return std::nullopt;
  last_ += step;
  return whole(step);
}

}  // namespace trammel
