#pragma once

#include "server/bias/coupled/coupled_search.h"
#include "server/bias/flange/flange_likelihood.h"

namespace trammel {

/// The starting values for the rotation, which stay if nothing shows a rotation: the mean length
/// scales of the position, and a size that moves the tool equally at half a metre.
[[nodiscard]] Eigen::VectorXd rotation_like(const std::vector<GpHyperparameters>& position);

/// The most probable hyperparameters of a bias at the flange, starting from those of its position
/// (`plain`): first with few joint vectors, then with all. With `again`, `plain` is the end of an
/// earlier fit, and the search uses all at once. The same seed gives the same answer, bit for bit.
/// Empty if the covariance is nowhere positive definite.
[[nodiscard]] std::optional<CoupledSearchResult> search_flange(
    const KernelPtr& kernel, const FlangeViews& views, const Eigen::MatrixXd& y,
    const CoupledHyperparameters& plain, double metrology_stddev, const SearchOptions& options,
    bool again);

}  // namespace trammel
