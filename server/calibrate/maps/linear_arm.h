#pragma once

#include <Eigen/Dense>
#include <array>

#include "server/calibrate/identify/scaled_parameters.h"
#include "server/calibrate/identify/weighting.h"

namespace trammel {

/// Equations of one kind about a model's present values, each in units of its sigma: r + J d =
/// noise.
struct LinearEquations {
  Eigen::MatrixXd information;  ///< P x P, JᵀJ
  Eigen::VectorXd downhill;     ///< P, -Jᵀr
  double square = 0;            ///< rᵀr
  double count = 0;  ///< of equations; rows at one joint vector that share an error count together
};

/// The information of a batch about small changes of all parameters, in units of `scaled.scale`.
/// Poses far off count for less, as in identification.
struct LinearArm {
  ScaledParameters scaled;
  std::array<LinearEquations, 2> kinds;  ///< of positions and gauges; of orientations
};

/// About the values of `problem.model`; the batch is of one session.
[[nodiscard]] LinearArm linear_arm(const CalibrationProblem& problem, const Weights& weights);

}  // namespace trammel
