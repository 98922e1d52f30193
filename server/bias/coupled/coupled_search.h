#pragma once

#include "server/bias/coupled/coupled_likelihood.h"
#include "server/bias/search/hyperparameter_search.h"

namespace trammel {

struct CoupledSearchResult {
  CoupledHyperparameters found;
  int starts_at_best = 0;  ///< starts that ended within kSameOptimum of the best on the subset
  int evaluations = 0;     ///< on all points
  bool given_up = false;   ///< `progress` returned false; nothing else is set
};

/// The task of the search: blocks, and the data with their columns.
struct CoupledTask {
  const LinearBlocks& blocks;
  const CoupledData& data;
};

/// The most probable hyperparameters of coupled processes. Several starts on a small subset, with
/// the same kernel parameters for all outputs; the best is carried to growing subsets and to all
/// points. Unless `shared_scales`, each output gets its own kernel parameters at last. Where `last`
/// is given, the search starts there, on all points, and nowhere else. Until the last stage blocks
/// may be `coarse`: with the same hyperparameters, and fewer columns. The same seed gives the same
/// answer, bit for bit. Empty when no start gave a positive definite covariance.
[[nodiscard]] std::optional<CoupledSearchResult> search_coupled(
    const std::shared_ptr<const Kernel>& kernel, const CoupledTask& task, const CoupledTask& coarse,
    const Eigen::VectorXd& metrology_stddev, bool shared_scales, const SearchOptions& options,
    const CoupledHyperparameters* last = nullptr);

}  // namespace trammel
