#pragma once

#include <vector>

#include "server/bias/process/gaussian_process.h"

namespace trammel {

/// Where a search of a ProfiledLikelihood ended.
struct Optimum : BfgsResult {
  Eigen::VectorXd signal_variance;  ///< of each output at x, m²
};

[[nodiscard]] Optimum improved(ProfiledLikelihood* likelihood, const Eigen::VectorXd& start,
                               const Eigen::MatrixXd& inverse_hessian, const BfgsOptions& options);

/// The same from nowhere in particular: a multiple of the identity stands for the Hessian.
[[nodiscard]] Optimum searched(ProfiledLikelihood* likelihood, const Eigen::VectorXd& start,
                               const BfgsOptions& options);

/// The inverse Hessian by differences of the gradient at `now`, no curvature below `least`. BFGS knows it along the
/// steps that it took only, and an idle joint's length scale is a direction that it hardly took.
void use_curvature(ProfiledLikelihood* likelihood, double least, Optimum* now);

/// log σ_n, m, mean over the outputs.
[[nodiscard]] double log_noise(const Optimum& optimum);
/// Whether they call clearly more or less of the data noise than each other.
[[nodiscard]] bool other_kind(const Optimum& a, const Optimum& b);

constexpr double kSameOptimum = 0.1;  ///< nat

/// Best first, of those that ended in the same place the better one, none without hope, at most `most`; one more if
/// that is needed to keep the best of the other kind than the first.
[[nodiscard]] std::vector<Optimum> different(std::vector<Optimum> optima, std::size_t most);

}  // namespace trammel
