#pragma once

#include "server/base/result.h"
#include "server/calibrate/identify/gauss_newton.h"

namespace trammel {

/// The most probable parameters under `weights`, from `start` (P, in units of the priors). Takes
/// full Gauss-Newton steps while they lead downhill, otherwise the guarded steps of Ceres. Refuses
/// if the solver fails.
[[nodiscard]] Result<Minimum> minimise(const CalibrationProblem& problem, const ScaledParameters& s,
                                       const Weights& weights, const CalibrateOptions& options,
                                       const Eigen::VectorXd& start);

}  // namespace trammel
