#pragma once

#include "server/compensate/budget/budget.h"
#include "server/compensate/compensated_model.h"

namespace trammel {

/// `measured`: rows with positions in the world of the model (in_world_of()), checked against its
/// cell; others are left out. Without rows that have a position the budget has no line.
[[nodiscard]] ErrorBudget error_budget(const CompensatedModel& model,
                                       const MeasurementBatch& measured);
/// The same at targets, where the error is the predicted one: nothing is left beyond the model.
[[nodiscard]] ErrorBudget error_budget(const CompensatedModel& model,
                                       const std::vector<PoseContext>& targets);
/// The same of a calibration, at the poses that it was made from: nothing is learned beside it.
[[nodiscard]] ErrorBudget error_budget(const CalibrationResult& calibration,
                                       const MeasurementBatch& measured);

/// What two models predict differently, 3 x N, m, in W; `learned` of it is by what they learned
/// beyond the physics.
struct PredictedDifference {
  std::vector<PoseContext> poses;
  Eigen::Matrix3Xd all, learned;
};
/// Of the difference between two models, whose parameters differ by those of `between`.
[[nodiscard]] ErrorBudget error_budget(const CalibrationResult& between,
                                       const PredictedDifference& predicted);

}  // namespace trammel
