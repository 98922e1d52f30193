#pragma once

#include <string>

#include "server/diagnose/evidence/linear_problem.h"

namespace trammel::cause_search {

/// `model` without the source of this name.
[[nodiscard]] PhysicalModel without_source(const PhysicalModel& model, const std::string& source);

/// R: the whitened effect of that source on the poses in the problem's model.
[[nodiscard]] Eigen::VectorXd effect_of_source(const LinearProblem& problem,
                                               const std::string& source);

/// Places of a source's parameters among all of the model's.
[[nodiscard]] std::vector<Eigen::Index> places_of_source(const PhysicalModel& model,
                                                         const std::string& source);

/// The parameters of one source in a joint estimate, in units of priors.
struct OwnEstimate {
  Eigen::VectorXd size;  ///< their values; 0 for an order, which gives the place of an oscillation
                         ///< and not its size
  Eigen::MatrixXd
      precision;  ///< the inverse of their covariance with everything else free, priors included
  [[nodiscard]] double strength() const { return size.dot(precision * size); }
};
/// `change`, `covariance`: the joint estimate of all numbers of a background, about where the model
/// stands.
[[nodiscard]] OwnEstimate own_estimate(const LinearProblem& problem, const std::string& source,
                                       const Eigen::VectorXd& change,
                                       const Eigen::MatrixXd& covariance);

}  // namespace trammel::cause_search
