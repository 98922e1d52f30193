#pragma once

#include "server/bias/coupled/coupled_search.h"
#include "server/bias/flange/flange_likelihood.h"

namespace trammel {

/// Where the search for the rotation begins, and what it is where nothing shows it: length scales
/// as those of the position in the mean, and a size that would move the tool by as much at half a
/// metre.
[[nodiscard]] Eigen::VectorXd rotation_like(const std::vector<GpHyperparameters>& position);

/// The most probable hyperparameters of a bias at the flange, from those of its position (`plain`)
/// on: first with few joint vectors, then with all. Where `again`, `plain` is where a fit ended,
/// and only all are used. The same seed gives the same answer, bit for bit. Empty when the
/// covariance is nowhere positive definite.
[[nodiscard]] std::optional<CoupledSearchResult> search_flange(
    const KernelPtr& kernel, const FlangeViews& views, const Eigen::MatrixXd& y,
    const CoupledHyperparameters& plain, double metrology_stddev, const SearchOptions& options,
    bool again);

}  // namespace trammel
