#pragma once

#include <Eigen/Dense>
#include <optional>
#include <string>
#include <vector>

#include "server/calibrate/identify/scaled_parameters.h"
#include "server/calibrate/identify/weighting.h"
#include "server/calibrate/sessions/session_blocks.h"

/// The most probable parameters in few steps. All vectors are of size P, in units of the priors.
namespace trammel {

/// Half the weighted sum of squares about one point, to second order without the second derivatives
/// of the residuals.
struct Expansion {
  double cost = 0;
  Eigen::VectorXd gradient;
  Eigen::MatrixXd information;  ///< P x P, second derivative without the part of the priors
  std::vector<SessionBlock> sessions =
      {};  ///< of several sessions: the settings of all but the newest, which is the world frame
};

/// About `x`; `robust`: with Huber's loss on every pose.
[[nodiscard]] Expansion expand(const CalibrationProblem& problem, const ScaledParameters& s,
                               const Weights& weights, bool robust, const Eigen::VectorXd& x);

/// The end of a minimisation.
struct Minimum {
  Eigen::VectorXd x;
  Eigen::MatrixXd information;  ///< of an Expansion about x, or about a point one negligible step
                                ///< before
  std::vector<double> costs;    ///< step by step
  bool converged = false;
  std::string message;
  std::vector<Similarity> moved = {};  ///< of several sessions: the motion that takes each into W
};

/// True if Huber's loss is used. It starts when the discrepancy is known, since outliers cannot be
/// recognised before.
[[nodiscard]] bool is_robust(const CalibrateOptions& options, const Weights& weights);

/// Full Gauss-Newton steps, which suffice if the start is near; empty if one leads uphill.
[[nodiscard]] std::optional<Minimum> full_steps(const CalibrationProblem& problem,
                                                const ScaledParameters& s, const Weights& weights,
                                                const CalibrateOptions& options,
                                                const Eigen::VectorXd& start);

/// Steps of the parameters and, for a batch of several sessions, of the sessions' own unknowns,
/// damped where a full step leads uphill. The information is that of the parameters, with the
/// sessions eliminated. Refuses if no step leads downhill away from the minimum.
[[nodiscard]] Result<Minimum> session_steps(const CalibrationProblem& problem,
                                            const ScaledParameters& s, const Weights& weights,
                                            const CalibrateOptions& options,
                                            const Eigen::VectorXd& start);

}  // namespace trammel
