#pragma once

#include <Eigen/Dense>
#include <optional>
#include <string>
#include <vector>

#include "server/calibrate/identify/scaled_parameters.h"
#include "server/calibrate/identify/weighting.h"

/// The posterior's minimum in few steps. All vectors are of size P, in units of the priors.
namespace trammel {

/// Half the weighted sum of squares about one point, to second order as Gauss and Newton have it.
struct Expansion {
  double cost = 0;
  Eigen::VectorXd gradient;
  Eigen::MatrixXd information;  ///< P x P, second derivative without the priors' share
};

/// About `x`; `robust`: with Huber's loss on every pose.
[[nodiscard]] Expansion expand(const CalibrationProblem& problem, const ScaledParameters& s, const Weights& weights,
                               bool robust, const Eigen::VectorXd& x);

/// What minimising came to.
struct Minimum {
  Eigen::VectorXd x;
  Eigen::MatrixXd information;  ///< of an Expansion about x, or a negligible step before it
  std::vector<double> costs;    ///< step by step
  bool converged = false;
  std::string message;
};

/// Before the discrepancy is known nothing can be called an outlier.
[[nodiscard]] bool is_robust(const CalibrateOptions& options, const Weights& weights);

/// Full Gauss-Newton steps, enough wherever the start is near; nothing where one of them leads uphill.
[[nodiscard]] std::optional<Minimum> full_steps(const CalibrationProblem& problem, const ScaledParameters& s,
                                                const Weights& weights, const CalibrateOptions& options,
                                                const Eigen::VectorXd& start);

}  // namespace trammel
