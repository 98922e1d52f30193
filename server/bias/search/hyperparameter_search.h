#pragma once

#include <cstdint>
#include <functional>

#include "server/bias/process/gaussian_process.h"

namespace trammel {

struct SearchOptions {
  int starts = 20;
  std::uint64_t seed = 1;
  std::function<bool(double)>
      progress;  ///< told the share done, in [0, 1]; returns false to give up
  std::vector<GpHyperparameters>
      last;  ///< if given, one for each output: the search refines these and has no other starts
};

struct SearchResult {
  std::vector<GpHyperparameters> outputs;
  int starts_at_best = 0;  ///< starts that ended within kSameOptimum of the best on the subset
  int evaluations = 0;     ///< on the largest set of points
  bool given_up = false;   ///< `progress` returned false; no other member is set
};

/// The most probable hyperparameters.
/// - Many starts on a small subset, with the same length scales for all outputs.
/// - The different optima are carried to more points and checked there by leave-one-out.
/// - They are refined for each output on growing subsets, at last on all points up to 2500. The
///   most likely one wins.
/// - If much more noise remains than the instrument has, shorter length scales are tried on more
///   points. With more than 1000 points, shorter and longer ones are tried on up to 2000 of them.
/// One seed gives one answer, bit for bit. Empty when no start gave a positive definite
/// covariance.
[[nodiscard]] std::optional<SearchResult> search_hyperparameters(
    const std::shared_ptr<const Kernel>& kernel, const GpData& data, double metrology_stddev,
    const SearchOptions& options);

}  // namespace trammel
