#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>

namespace trammel {

/// The durations of pieces of work, counted in classes whose bounds never change. Thread-safe,
/// without a lock; add() costs some ten nanoseconds.
class LatencyHistogram {
 public:
  /// Upper bounds of the classes, s. One more class has the values above the last bound.
  static constexpr std::array<double, 16> kBounds = {0.0001, 0.00025, 0.0005, 0.001, 0.0025, 0.005,
                                                     0.01,   0.025,   0.05,   0.1,   0.25,   0.5,
                                                     1,      2.5,     5,      10};

  struct Counts {
    std::array<std::uint64_t, kBounds.size() + 1> in_class{};
    double sum = 0;  ///< s
  };

  void add(std::chrono::nanoseconds took) {
    const double seconds = std::chrono::duration<double>(took).count();
    const auto bound = std::lower_bound(kBounds.begin(), kBounds.end(), seconds);
    in_class_[static_cast<std::size_t>(bound - kBounds.begin())].fetch_add(
        1, std::memory_order_relaxed);
    sum_ns_.fetch_add(static_cast<std::uint64_t>(std::max<std::int64_t>(0, took.count())),
                      std::memory_order_relaxed);
  }

  [[nodiscard]] Counts counts() const {
    Counts now;
    for (std::size_t i = 0; i < in_class_.size(); ++i)
      now.in_class[i] = in_class_[i].load(std::memory_order_relaxed);
    now.sum = 1e-9 * static_cast<double>(sum_ns_.load(std::memory_order_relaxed));
    return now;
  }

 private:
  std::array<std::atomic<std::uint64_t>, kBounds.size() + 1> in_class_{};
  std::atomic<std::uint64_t> sum_ns_{0};
};

}  // namespace trammel
