#pragma once

#include <chrono>
#include <cstdint>
#include <optional>

namespace trammel {

/// Notices that this host's clock was set, by a clock that nobody sets. What is stored is dated by
/// the former.
class ClockWatch {
 public:
  static constexpr std::chrono::seconds kNoticed{
      2};  ///< a smaller step does not matter to what is dated in seconds
  struct Time {
    std::chrono::milliseconds unix_time, since_boot;
  };
  [[nodiscard]] static Time now();

  explicit ClockWatch(Time begin) : begin_(shift(begin)), last_(begin_) {}

  /// By how much it was set since the last look; empty: it was not.
  [[nodiscard]] std::optional<std::chrono::seconds> look(Time now);
  /// By how much it was set in all.
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
