#pragma once

#include <Eigen/Dense>

#include "server/calibrate/identify/scaled_parameters.h"
#include "server/calibrate/identify/weighting.h"

namespace trammel {

/// One measurement's residual in units of its sigma, by parameters in units of their scale; those that are held move
/// nothing. Refers to what it is made of.
class WeightedPose {
 public:
  WeightedPose(const PhysicalModel& model, const ScaledParameters& s, const Measurement& measurement,
               const Weights& weights);

  /// How many equations: 6, or 3 without an orientation.
  [[nodiscard]] int size() const { return measurement_.R_WT ? 6 : 3; }
  /// At `x` (P): `residuals` (size()), and `jacobian` (size() x P by rows) unless it is null. False: not finite.
  bool evaluate(const double* x, double* residuals, double* jacobian) const;
  /// Norm of the residuals that 1 in 1000 good poses exceeds.
  [[nodiscard]] double huber_limit() const;

 private:
  const PhysicalModel& model_;
  const Eigen::VectorXd& scale_;
  const std::vector<bool>& held_;
  const Measurement& measurement_;
  double weight_;
  double rotation_weight_;
};

}  // namespace trammel
