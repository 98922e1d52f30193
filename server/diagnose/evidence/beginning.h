#pragma once

#include "server/diagnose/evidence/background.h"
#include "server/diagnose/evidence/linear_problem.h"

namespace trammel {

/// Twice the log likelihood that a beginning may lack and still be in its 95 % set. Where a step is, is no smooth
/// parameter: chi-square's 3.84 would hold it in 73 % of small steps only (1 - (1 - exp(-c/2))² = 0.05; Hansen,
/// Econometrica 68, 2000, table I).
constexpr double kBeginning95 = 7.35;

/// Poses (their places in the batch, ascending) at which a step may have begun, with 95 % confidence. `always` (R x m,
/// whitened, per prior): the step as if it acted at all poses; `data` (R): what is left with everything but the step
/// taken off; `rest`: everything that is free beside it. `found` is always among them.
[[nodiscard]] std::vector<Eigen::Index> possible_beginnings(const LinearProblem& problem, const Eigen::MatrixXd& always,
                                                            const Background& rest, const Eigen::VectorXd& data,
                                                            Eigen::Index found);

}  // namespace trammel
