#pragma once

#include <map>
#include <optional>
#include <string>

#include "server/compensate/budget/budget.h"
#include "server/compensate/compensated_model.h"

namespace trammel {

/// True if such rows allow a budget: some have a position, and no tool has all its positions at one
/// place. At one place, base, tool and zeros of the last joints have the same effect.
[[nodiscard]] bool tells_a_budget(const MeasurementBatch& measured);

/// `measured`: rows with positions in the world of the model (in_world_of()), checked against its
/// cell; other rows are left out. Without any position the budget has no line.
[[nodiscard]] ErrorBudget error_budget(const CompensatedModel& model,
                                       const MeasurementBatch& measured);
/// The budget at targets. There the error is the predicted one, so no residual is left beyond the
/// model.
[[nodiscard]] ErrorBudget error_budget(const CompensatedModel& model,
                                       const std::vector<PoseContext>& targets);
/// The session at which a change of the arm began, by the name of its error source.
using Since = std::map<std::string, std::string>;
/// The budget of a calibration, at its own poses; no bias is learned beside it.
[[nodiscard]] ErrorBudget error_budget(const CalibrationResult& calibration,
                                       const MeasurementBatch& measured, const Since& since = {});

/// The difference between two models' predictions, 3 x N, m, in W. `learned` is the part of their
/// biases.
struct PredictedDifference {
  std::vector<PoseContext> poses;
  Eigen::Matrix3Xd all, learned;
  /// The part that another load makes (`load_change`); no column: both carry the same load.
  Eigen::Matrix3Xd load;
  std::optional<BudgetNumber> load_change;  ///< of the mass, kg
};
/// The budget of the difference between two models; `between` has the differences of their
/// parameters.
[[nodiscard]] ErrorBudget error_budget(const CalibrationResult& between,
                                       const PredictedDifference& predicted);

/// m rms: the effect of a joint's zero (0-based) that is off by `by`, rad (m for a rail), at
/// positions beyond the part that touching base and tool frames would remove. Not a number without
/// poses.
[[nodiscard]] double alone_of_zero(const CompensatedModel& model, int joint, double by,
                                   const MeasurementBatch& measured);

}  // namespace trammel
