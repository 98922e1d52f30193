#pragma once

#include <string>
#include <vector>

#include "server/base/result.h"
#include "server/bias/bias_data.h"
#include "server/bias/kernels/kernel_spelling.h"

/// Refuses data from which no bias can be learned or restored.
namespace trammel {

/// The most observations of a kernel with blocks: learning from so many takes half a gigabyte.
inline constexpr Eigen::Index kMostCoupled = 4000;

/// Limit for a bias at the flange, in numbers: 3 for each joint vector with one lever, 5 with two,
/// 6 with more. The bias keeps a matrix of their square, 128 MB.
inline constexpr Eigen::Index kMostFlangeNumbers = 4000;

[[nodiscard]] Status check_observations(const Eigen::MatrixXd& q, const Eigen::MatrixXd& residual_B,
                                        const Eigen::VectorXd& sigma);
/// The features of `n` observations for a kernel with blocks.
[[nodiscard]] Status check_features(const std::string& kernel,
                                    const std::vector<BiasFeatures>& features, Eigen::Index n);
/// Makes the same checks for a bias at the flange, and checks that it has few enough joint vectors.
[[nodiscard]] Status check_flange(const Eigen::MatrixXd& q,
                                  const std::vector<BiasFeatures>& features);
/// Checks that the hyperparameters of `state` have the shape that `bias` needs, and its features
/// too if `bias` has blocks.
[[nodiscard]] Status check_hyperparameters(const BiasState& state, const SpelledBias& bias);

}  // namespace trammel
