#pragma once

#include <cstdint>
#include <vector>

#include "server/diagnose/diagnosis.h"
#include "server/diagnose/evidence/background.h"
#include "server/diagnose/evidence/linear_problem.h"

namespace trammel::cause_search {

/// Chance of a distance covariance as large as that of the rows of `x` and `y` (as many each, at
/// least 4) if they are independent. The rows are permuted until ten permutations are as large
/// (Besag and Clifford 1991). Where 999 of them do not bring ten, the p-value lies in the tail.
/// There the statistic is a sum of chi-squares, weighted by the products of the eigenvalues of both
/// distance matrices (Szekely and others 2007); its tail, by saddlepoint (Lugannani and Rice 1980),
/// goes on from the tenth largest permutation. Not below kLeastPValue.
[[nodiscard]] double independence_p_value(const Eigen::MatrixXd& x, const Eigen::MatrixXd& y,
                                          std::uint64_t seed);

/// The dependence of what is left, or of its size, on a joint, on the torque of gravity or on time:
/// distance covariance, Holm-corrected, sorted by p-value. `left`: what `background` leaves of the
/// residual, whitened rows. Each pose is brought to unit variance, because a fit leaves less where
/// it leans on few poses.
[[nodiscard]] std::vector<Dependence> dependence_of(const LinearProblem& problem,
                                                    const Background& background,
                                                    const Eigen::VectorXd& left,
                                                    std::uint64_t seed);

}  // namespace trammel::cause_search
