#pragma once

#include <cstdint>

#include "idl/repairs/guard/recent_table.h"

namespace trammel::wire {

/// Largest sequence number that passes: a million samples a second for nine years.
inline constexpr std::int64_t kLargestNumber = std::int64_t{1} << 48;

/// Lets writers skip sequence numbers in steps that the library takes in milliseconds: it counts
/// through all that a HEARTBEAT or a GAP leaves out, one by one, with its reader locked. Small
/// ranges pass. Larger ones are cut to a step beyond what our own reader has confirmed; the rest
/// comes with the writer's next message. All writers together have a budget. Also notes counts: the
/// library ignores every message whose count is not above the highest before.
class SequenceWatch {
 public:
  using Time = std::chrono::steady_clock::time_point;
  static constexpr std::int64_t kFreely = 4096;  ///< numbers skipped without counting them
  /// Under half a second on a slow host: who stands still for longer than a lease takes himself for
  /// one that slept.
  static constexpr std::int64_t kHeartbeatStep = std::int64_t{1} << 20;
  /// For a signed message, which passes whole or not at all: the most that an honest writer skips
  /// when it is met again.
  static constexpr std::int64_t kSignedStep = std::int64_t{1} << 22;
  static constexpr std::int64_t kGapStep = std::int64_t{1} << 17;
  static constexpr std::uint32_t kCountStep = 1u << 24;

  /// Our own reader has asked `writer` for what follows `number`: all up to there is behind it.
  void confirmed(const EndpointKey& writer, std::int64_t number, Time now) {
    known_.at(writer, now).confirmed = number;
  }
  /// The most that `first` of a HEARTBEAT may be, in steps of so many numbers.
  [[nodiscard]] std::int64_t heartbeat(const EndpointKey& writer, std::int64_t first,
                                       std::int64_t step, Time now);
  /// The part of GAP [start, end) that may pass; empty: none now.
  struct Range {
    std::int64_t start, end;
  };
  [[nodiscard]] Range gap(const EndpointKey& writer, Range asked, Time now);
  /// False when the count has jumped. `key` tells apart whatever counts for itself.
  [[nodiscard]] bool count(const EndpointKey& key, std::uint32_t count, Time now);

 private:
  struct Known {
    std::int64_t confirmed = 0;
    std::int64_t granted = 0;  // paid for from the budget
    Range gap{0, 0};           // the last one that was cut: where it began, how far it got
    std::uint32_t count = 0;
    bool counted = false;
  };
  /// The part of `wanted` that the budget allows; each number costs `weight`.
  std::int64_t granted(std::int64_t wanted, std::int64_t step, std::int64_t weight, Time now);

  RecentTable<Known, 1024> known_;
  std::int64_t budget_ = kBudget;
  Time refilled_{};
  static constexpr std::int64_t kBudget = std::int64_t{1}
                                          << 26;  // of HEARTBEATs' numbers, a second
  static constexpr std::int64_t kGapWeight = 16;
};

}  // namespace trammel::wire
