#pragma once

#include <string>
#include <vector>

#include "server/diagnose/evidence/linear_problem.h"

/// The sign of play. A joint with play lags behind its motor: after moving up it is too low. So the
/// play b + k |tau| is positive by definition (backlash.cpp). With the other sign the joint would
/// go beyond its command, which no gap between teeth does.
namespace trammel::cause_search {

/// Play of one joint over the poses that were approached from a known side.
struct PlaySign {
  int joint = 0;
  double mean = 0, stddev = 0;  ///< rad: of b + k |tau| over those poses
  bool negative = false;        ///< beyond chance, on average or at a quarter of those poses
};

/// The play of `joint`, which the model has as `source`. `change`, `covariance`: the joint estimate
/// of all parameters about where the model stands, in units of priors.
[[nodiscard]] PlaySign sign_of_play(const LinearProblem& problem, const std::string& source,
                                    int joint, const Eigen::VectorXd& change,
                                    const Eigen::MatrixXd& covariance);

/// The possible reasons for play of the wrong sign, for people. `every`: no joint has play of the
/// right sign.
[[nodiscard]] std::string what_negative_play_may_be(const std::vector<PlaySign>& negative,
                                                    bool every);

}  // namespace trammel::cause_search
