#pragma once

#include <cstdint>
#include <vector>

#include "server/diagnose/diagnosis.h"
#include "server/diagnose/linear_problem.h"

namespace trammel {

/// Whether what is left, or its size, depends on a joint, on gravity's torque or on time: distance correlation (Székely
/// and others 2007), by permutation of the poses, corrected for the number of questions after Holm. Sorted by p.
[[nodiscard]] std::vector<Dependence> dependence_of(const LinearProblem& problem, const Eigen::VectorXd& left,
                                                    std::uint64_t seed);

}  // namespace trammel
