#pragma once

#include <Eigen/Dense>

#include "server/calibrate/identify/scaled_parameters.h"
#include "server/calibrate/identify/weighting.h"

namespace trammel {

/// The residual of one measurement in units of sigma, as a function of the F free parameters in
/// units of their scale. Keeps references to its arguments.
class WeightedPose {
 public:
  /// `row`: its place in the batch that the weights are of.
  WeightedPose(const PhysicalModel& model, const ScaledParameters& s,
               const Measurement& measurement, const Weights& weights, std::size_t row = 0);

  /// The number of equations: 6, 3 without an orientation, Gauge::numbers() of a gauge.
  [[nodiscard]] int size() const {
    return measurement_.gauge ? measurement_.gauge->numbers() : measurement_.R_WT ? 6 : 3;
  }
  /// At `x` (F): `residuals` (size()), and `jacobian` (size() x F by rows) unless it is null.
  /// False: not finite.
  bool evaluate(const double* x, double* residuals, double* jacobian) const;
  [[nodiscard]] double inverse_sigma() const { return inverse_sigma_; }  ///< 1/m
  [[nodiscard]] double inverse_rotation_sigma() const {
    return inverse_rotation_sigma_;
  }  ///< 1/rad
  /// The norm of the residuals that 1 in 1000 good poses exceeds.
  [[nodiscard]] double huber_limit() const;

 private:
  bool evaluate_gauge(const Eigen::VectorXd& values, double* residuals, double* jacobian) const;

  const PhysicalModel& model_;
  const ScaledParameters& s_;
  const Measurement& measurement_;
  double inverse_sigma_;           // 1/m, of one axis or of the gauge, discrepancy included
  double inverse_rotation_sigma_;  // 1/rad
};

}  // namespace trammel
