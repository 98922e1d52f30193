#pragma once

#include <optional>

#include "server/bias/kernels/kernel_spelling.h"

/// The number of harmonics that the block `joint_map` has in a bias.
namespace trammel {

/// The number of harmonics that so many observations can determine.
[[nodiscard]] Eigen::Index harmonics_for(Eigen::Index observations);

/// The number of harmonics in a model with these hyperparameters, for an arm with so many joints.
/// Empty: a model without a learned power.
[[nodiscard]] std::optional<Eigen::Index> harmonics_in(const Eigen::VectorXd& block_hyperparameters,
                                                       Eigen::Index joints);

/// `bias` with so many harmonics in its maps and a learned power. `told`: the number stored among
/// the hyperparameters, if a search begins with fewer.
[[nodiscard]] SpelledBias with_harmonics(SpelledBias bias, Eigen::Index harmonics,
                                         Eigen::Index told);

}  // namespace trammel
