#pragma once

#include <string>

#include "server/diagnose/evidence/linear_problem.h"

namespace trammel {

/// `model` without the source of that name.
[[nodiscard]] PhysicalModel without_source(const PhysicalModel& model, const std::string& source);

/// R: what the source of that name does to the poses in the problem's model, whitened.
[[nodiscard]] Eigen::VectorXd effect_of_source(const LinearProblem& problem, const std::string& source);

/// Places of a source's parameters among all of the model's.
[[nodiscard]] std::vector<Eigen::Index> places_of_source(const PhysicalModel& model, const std::string& source);

/// One source's share of a joint estimate, in units of priors.
struct OwnEstimate {
  Eigen::VectorXd size;       ///< how far its parameters make it act
  Eigen::MatrixXd precision;  ///< of them, everything else free: the inverse of their covariance, priors included
  [[nodiscard]] double strength() const { return size.dot(precision * size); }
};
/// `change` and `covariance`: the joint estimate of all of a background's numbers, about where the model stands.
[[nodiscard]] OwnEstimate own_estimate(const LinearProblem& problem, const std::string& source,
                                       const Eigen::VectorXd& change, const Eigen::MatrixXd& covariance);

}  // namespace trammel
