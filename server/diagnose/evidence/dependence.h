#pragma once

#include <cstdint>
#include <vector>

#include "server/diagnose/diagnosis.h"
#include "server/diagnose/evidence/background.h"
#include "server/diagnose/evidence/linear_problem.h"

namespace trammel {

/// Chance of a distance covariance as large as that of the rows of `x` and `y` (as many each, at least 4) if they had
/// nothing to do with one another. By permutation of the rows, until ten came out as large (Besag and Clifford 1991).
/// What 999 permutations do not reach ten times lies in the tail: there the statistic is a sum of chi-squares weighted
/// by the products of the eigenvalues of both distance matrices (Szekely and others 2007), whose tail (saddlepoint,
/// Lugannani and Rice 1980) goes on from the tenth largest permutation. Not below 1e-6: no tail is known further.
[[nodiscard]] double independence_p_value(const Eigen::MatrixXd& x, const Eigen::MatrixXd& y, std::uint64_t seed);

/// Whether what is left, or its size, depends on a joint, on gravity's torque or on time: distance covariance,
/// corrected for the number of questions after Holm. Sorted by p. `left` is what `background` leaves of the residual,
/// whitened rows; each pose is brought to unit variance, since a fit leaves less where it leans on few poses. `p_value`
/// 1e-6 stands for 1e-6 or less.
[[nodiscard]] std::vector<Dependence> dependence_of(const LinearProblem& problem, const Background& background,
                                                    const Eigen::VectorXd& left, std::uint64_t seed);

}  // namespace trammel
