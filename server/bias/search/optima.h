#pragma once

#include <vector>

#include "server/bias/process/gaussian_process.h"

namespace trammel {

/// The end of a search of a ProfiledLikelihood.
struct Optimum : BfgsResult {
  Eigen::VectorXd signal_variance;  ///< of each output at x, m²
};

[[nodiscard]] Optimum improved(ProfiledLikelihood* likelihood, const Eigen::VectorXd& start,
                               const Eigen::MatrixXd& inverse_hessian, const BfgsOptions& options);

/// Searches without a known Hessian: it starts as a multiple of the identity.
[[nodiscard]] Optimum searched(ProfiledLikelihood* likelihood, const Eigen::VectorXd& start,
                               const BfgsOptions& options);

/// Sets the inverse Hessian of `now` from differences of the gradient, no curvature below `least`.
/// BFGS knows it along its steps only, and it hardly steps along the length scale of a joint
/// without influence.
void use_curvature(ProfiledLikelihood* likelihood, double least, Optimum* now);

/// log σ_n (m), mean over the outputs.
[[nodiscard]] double log_noise(const Optimum& optimum);
/// True if one of them explains clearly more of the data as noise than the other.
[[nodiscard]] bool other_kind(const Optimum& a, const Optimum& b);

/// The different optima, best first, at most `most`, without hopeless ones. It adds one more if the
/// best of the other kind (other_kind()) would be missing.
[[nodiscard]] std::vector<Optimum> different(std::vector<Optimum> optima, std::size_t most);

}  // namespace trammel
