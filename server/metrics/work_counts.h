#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <string>

#include "server/base/mutex.h"

namespace trammel {

/// The requests to a cell, and the certainty of the answers. They show whether the work is where
/// the model knows the arm.
struct WorkFigures {
  /// Upper bounds of the classes of stated deviations, mm. One more class has the values above the
  /// last bound.
  static constexpr std::array<double, 9> kBounds = {0.01, 0.02, 0.03, 0.05, 0.1, 0.2, 0.3, 0.5, 1};

  std::uint64_t inside = 0;   ///< poses in the model's domain
  std::uint64_t outside = 0;  ///< poses outside, answered by physics more or less alone
  std::uint64_t left = 0;     ///< targets that were left alone
  std::array<std::uint64_t, kBounds.size() + 1> in_class{};
  double sum_mm = 0;  ///< of the promised deviations

  /// Counts an answer with this standard deviation of the true error (root mean square of the three
  /// axes), m.
  void answered(bool in_domain, double stddev) {
    ++(in_domain ? inside : outside);
    const double mm = 1e3 * stddev;
    const auto bound = std::lower_bound(kBounds.begin(), kBounds.end(), mm);
    ++in_class[static_cast<std::size_t>(bound - kBounds.begin())];
    sum_mm += mm;
  }
  WorkFigures& operator+=(const WorkFigures& more) {
    inside += more.inside;
    outside += more.outside;
    left += more.left;
    for (std::size_t i = 0; i < in_class.size(); ++i) in_class[i] += more.in_class[i];
    sum_mm += more.sum_mm;
    return *this;
  }
};

/// The work of all cells since the start. Thread-safe; asked for once a portion of a request.
class WorkCounts {
 public:
  void add(const std::string& cell, const WorkFigures& portion) {
    const MutexLock lock(mutex_);
    cells_[cell] += portion;
  }
  [[nodiscard]] std::map<std::string, WorkFigures> all() const {
    const MutexLock lock(mutex_);
    return cells_;
  }

 private:
  mutable Mutex mutex_;
  std::map<std::string, WorkFigures> cells_ TRAMMEL_GUARDED_BY(mutex_);
};

}  // namespace trammel
