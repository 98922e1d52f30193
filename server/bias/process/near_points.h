#pragma once

#include <Eigen/Dense>
#include <vector>

#include "server/bias/kernels/kernel.h"
#include "server/numerics/aligned_matrix.h"

namespace trammel {

/// Weights of the points near a target in its mean, Σ weights y; they are (R + noise)⁻¹ r of
/// these points.
struct NearWeights {
  std::vector<Eigen::Index> points;  ///< rising
  Eigen::VectorXd weights;
};

/// The variance that the points leave which a target has most in common with. Fewer points know
/// less, so it is never below the variance that all points leave. Nothing is kept for it. Refers to
/// what it is made of.
struct NearPoints {
  static constexpr Eigen::Index kMost = 48;

  const Kernel& kernel;
  const Eigen::VectorXd& parameters;
  const AlignedMatrix& features;  ///< of the points, padded
  const Eigen::VectorXd& noise;   ///< of each point, relative to σ_f²
  Eigen::Index count;             ///< of near ones; at most kMost, and fewer than there are points

  /// The covariance of a target (one row of features) with each point, a padded column in units of
  /// σ_f².
  [[nodiscard]] AlignedMatrix covariance_with(const FeatureBlock& target) const;

  /// The variance that is left of `prior`, that of a target without data, in units of σ_f².
  /// `covariance`: the target's with each point; minus infinity takes a point out. Tells the points
  /// and their weights, too, where it is asked for them.
  [[nodiscard]] double left_of(const AlignedMatrix& covariance, double prior,
                               NearWeights* weights = nullptr) const;
};

}  // namespace trammel
