#pragma once

#include <cstdint>
#include <functional>

#include "server/bias/process/gaussian_process.h"

namespace trammel {

struct SearchOptions {
  int starts = 20;
  std::uint64_t seed = 1;
  std::function<bool(double)> progress;  ///< share done in [0, 1]; false gives up
  std::vector<GpHyperparameters> last;   ///< not empty: refine these, one for each output, and start nowhere else
};

struct SearchResult {
  std::vector<GpHyperparameters> outputs;
  int starts_at_best = 0;  ///< starts that ended within 0.1 nat of the best on the subset
  int evaluations = 0;     ///< on the largest set of points
  bool given_up = false;   ///< `progress` said so; nothing else is then meant
};

/// Most probable hyperparameters. Many starts on a small subset with shared length scales; different optima are carried
/// to more points, checked there by leave-one-out, and refined for each output on growing subsets, at last on all
/// points up to 2500; the best by likelihood wins. Where much more noise is left than metrology knows of, shorter
/// length scales are tried on more points too, and where there are more than 1000, finer and idler ones on up to 2000
/// of them. The same seed gives the same answer, bit for bit. Empty when no start
/// gave a positive definite covariance.
[[nodiscard]] std::optional<SearchResult> search_hyperparameters(const std::shared_ptr<const Kernel>& kernel,
                                                                 const GpData& data, double metrology_stddev,
                                                                 const SearchOptions& options);

}  // namespace trammel
