#pragma once

#include <string>
#include <vector>

#include "server/base/result.h"
#include "server/bias/bias_data.h"
#include "server/bias/kernels/kernel_spelling.h"

/// What a bias cannot be learned or restored from, in sentences that name row, value and limit.
namespace trammel {

/// Observations that a kernel with blocks may have: half a gigabyte while they are learned from.
inline constexpr Eigen::Index kMostCoupled = 4000;

[[nodiscard]] Status check_observations(const Eigen::MatrixXd& q, const Eigen::MatrixXd& residual_B,
                                        const Eigen::VectorXd& sigma);
/// Of a kernel with blocks and `n` observations.
[[nodiscard]] Status check_features(const std::string& kernel, const std::vector<BiasFeatures>& features,
                                    Eigen::Index n);
/// Against what `bias` and, where it has blocks, the state's own features ask for.
[[nodiscard]] Status check_hyperparameters(const BiasState& state, const SpelledBias& bias);

}  // namespace trammel
