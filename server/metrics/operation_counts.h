#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>

#include "server/metrics/latency_histogram.h"

namespace trammel {

/// The counts of the requests of one operation. Thread-safe, without a lock.
class OperationCounts {
 public:
  static constexpr std::size_t kResults =
      32;  ///< result codes with a counter of their own; higher ones count as the last

  /// Counts a request with this result, `times` times (with its repeats).
  void answered(std::size_t result, std::uint64_t times) {
    by_result_[std::min(result, kResults - 1)].fetch_add(times, std::memory_order_relaxed);
  }
  /// A request was worked on, from its arrival until its reply was handed over.
  void took(std::chrono::nanoseconds time) { latency_.add(time); }

  [[nodiscard]] std::uint64_t of_result(std::size_t result) const {
    return by_result_[result].load(std::memory_order_relaxed);
  }
  [[nodiscard]] LatencyHistogram::Counts latency() const { return latency_.counts(); }

 private:
  std::array<std::atomic<std::uint64_t>, kResults> by_result_{};
  LatencyHistogram latency_;
};

}  // namespace trammel
