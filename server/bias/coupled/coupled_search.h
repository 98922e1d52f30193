#pragma once

#include "server/bias/coupled/coupled_likelihood.h"
#include "server/bias/search/hyperparameter_search.h"

namespace trammel {

struct CoupledSearchResult {
  CoupledHyperparameters found;
  int starts_at_best = 0;  ///< starts that ended within kSameOptimum of the best on the subset
  int evaluations = 0;     ///< on all points
  bool given_up = false;   ///< `progress` returned false; no other member is set
};

/// The task of the search: blocks, and the data with their columns.
struct CoupledTask {
  const LinearBlocks& blocks;
  const CoupledData& data;
};

/// The most probable hyperparameters of coupled processes. Several starts run on a small subset,
/// with common kernel parameters for all outputs. The best continues on growing subsets and on all
/// points. Unless `shared_scales`, each output gets its own kernel parameters in the last stage. If
/// `last` is given, the search starts only there, on all points. Before the last stage, blocks may
/// be `coarse`: the same hyperparameters with fewer columns. The same seed gives the same answer,
/// bit for bit. Empty if no start gave a positive definite covariance.
[[nodiscard]] std::optional<CoupledSearchResult> search_coupled(
    const std::shared_ptr<const Kernel>& kernel, const CoupledTask& task, const CoupledTask& coarse,
    const Eigen::VectorXd& metrology_stddev, bool shared_scales, const SearchOptions& options,
    const CoupledHyperparameters* last = nullptr);

}  // namespace trammel
