#pragma once

#include <Eigen/Dense>
#include <vector>

#include "server/bias/kernels/kernel.h"
#include "server/numerics/aligned_matrix.h"

namespace trammel {

/// Weights of the points near a target in its mean, Σ weights y: the vector (R + noise)⁻¹ r of
/// these points.
struct NearWeights {
  std::vector<Eigen::Index> points;  ///< rising
  Eigen::VectorXd weights;
};

/// The variance of a target given the points with the largest covariance with it. Fewer points know
/// less, so it is never below the variance given all points. It stores nothing of its own, and
/// refers to its arguments.
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

  /// The variance left of `prior`, the variance of a target without data, in units of σ_f².
  /// `covariance` is that of the target with each point; minus infinity excludes a point. On
  /// request it also returns the points and their weights.
  [[nodiscard]] double left_of(const AlignedMatrix& covariance, double prior,
                               NearWeights* weights = nullptr) const;
};

}  // namespace trammel
