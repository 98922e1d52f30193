#pragma once

#include <string>

#include "server/diagnose/linear_problem.h"

namespace trammel {

/// `model` without the source of that name.
[[nodiscard]] PhysicalModel without_source(const PhysicalModel& model, const std::string& source);

/// R: what the source of that name does to the poses in the problem's model, whitened.
[[nodiscard]] Eigen::VectorXd effect_of_source(const LinearProblem& problem, const std::string& source);

/// Places of a source's parameters among all of the model's.
[[nodiscard]] std::vector<Eigen::Index> places_of_source(const PhysicalModel& model, const std::string& source);

}  // namespace trammel
