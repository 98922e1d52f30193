#pragma once

#include <chrono>
#include <cstdint>
#include <optional>

namespace trammel {

/// Notices changes of this host's clock, which dates the stored data, by a monotonic clock.
class ClockWatch {
 public:
  static constexpr std::chrono::seconds kNoticed{
      2};  ///< dates have seconds, so a smaller step does not matter
  struct Time {
    std::chrono::milliseconds unix_time, since_boot;
  };
  [[nodiscard]] static Time now();

  explicit ClockWatch(Time begin) : begin_(shift(begin)), last_(begin_) {}

  /// The change of the clock since the last look; empty: none.
  [[nodiscard]] std::optional<std::chrono::seconds> look(Time now);
  /// The total change of the clock.
  [[nodiscard]] std::chrono::seconds off() const { return whole(last_ - begin_); }

 private:
  [[nodiscard]] static std::chrono::milliseconds shift(Time time) {
    return time.unix_time - time.since_boot;
  }
  [[nodiscard]] static std::chrono::seconds whole(std::chrono::milliseconds time) {
    return std::chrono::round<std::chrono::seconds>(time);
  }

  const std::chrono::milliseconds begin_;
  std::chrono::milliseconds last_;
};

}  // namespace trammel
