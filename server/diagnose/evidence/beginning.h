#pragma once

#include "server/diagnose/evidence/background.h"
#include "server/diagnose/evidence/linear_problem.h"

namespace trammel::cause_search {

/// Twice the log likelihood by which a beginning may be worse than the best and still be in the 95
/// % set. The place of a step is no smooth parameter: chi-square's 3.84 would hold a small step in
/// 73 % of the cases only. c solves 1 - (1
/// - exp(-c/2))² = 0.05 (Hansen, Econometrica 68, 2000, table I).
constexpr double kBeginning95 = 7.35;

/// Places in the batch, ascending, at which a step may have begun, with 95 % confidence. `found`,
/// the place where it was found, is always among them. `always` (R x m, whitened, per prior): the
/// step as if it acted at all poses. `data` (R): the residual without any effect but the step.
/// `rest`: all free columns beside it.
[[nodiscard]] std::vector<Eigen::Index> possible_beginnings(const LinearProblem& problem,
                                                            const Eigen::MatrixXd& always,
                                                            const Background& rest,
                                                            const Eigen::VectorXd& data,
                                                            Eigen::Index found);

}  // namespace trammel::cause_search
