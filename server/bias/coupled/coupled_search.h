#pragma once

#include "server/bias/coupled/coupled_likelihood.h"
#include "server/bias/search/hyperparameter_search.h"

namespace trammel {

struct CoupledSearchResult {
  CoupledHyperparameters found;
  int starts_at_best = 0;  ///< starts that ended within 0.1 nat of the best on the subset
  int evaluations = 0;     ///< on all points
  bool given_up = false;   ///< `progress` said so; nothing else is then meant
};

/// Most probable hyperparameters of coupled processes: several starts on a small subset with one set of kernel
/// parameters for all outputs, the best carried to growing subsets and to all points; unless `shared_scales`, each
/// output then gets its own. From `last`, where given, on all points and from nowhere else. Same seed, same answer, bit
/// for bit. Empty when no start gave a positive definite covariance.
[[nodiscard]] std::optional<CoupledSearchResult> search_coupled(const std::shared_ptr<const Kernel>& kernel,
                                                                const LinearBlocks& blocks, const CoupledData& data,
                                                                const Eigen::VectorXd& metrology_stddev,
                                                                bool shared_scales, const SearchOptions& options,
                                                                const CoupledHyperparameters* last = nullptr);

}  // namespace trammel
