#pragma once

#include <cstdint>
#include <vector>

#include "server/diagnose/diagnosis.h"
#include "server/diagnose/evidence/background.h"
#include "server/diagnose/evidence/linear_problem.h"

namespace trammel::cause_search {

/// The chance that independent rows of `x` and `y` (equally many, at least 4) have at least the
/// observed distance covariance. The rows are permuted until ten permutations reach it (Besag and
/// Clifford 1991). If 999 permutations do not give ten, the p-value is in the tail. There the
/// statistic is a sum of chi-squares, weighted by the products of the eigenvalues of both distance
/// matrices (Szekely and others 2007). Its tail, by saddlepoint (Lugannani and Rice 1980),
/// continues from the tenth largest permutation. At least kLeastPValue.
[[nodiscard]] double independence_p_value(const Eigen::MatrixXd& x, const Eigen::MatrixXd& y,
                                          std::uint64_t seed);

/// The dependence of the residual, or of its size, on a joint, on the torque of gravity or on time:
/// distance covariance, Holm-corrected, sorted by p-value. `left`: the residual after `background`,
/// whitened rows. Each pose is scaled to unit variance, because a fit leaves less where it rests on
/// few poses.
[[nodiscard]] std::vector<Dependence> dependence_of(const LinearProblem& problem,
                                                    const Background& background,
                                                    const Eigen::VectorXd& left,
                                                    std::uint64_t seed);

}  // namespace trammel::cause_search
