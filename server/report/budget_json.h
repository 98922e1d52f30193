#pragma once

#include <nlohmann/json.hpp>

#include "server/compensate/budget/budget.h"

namespace trammel {

/// A line in the form of every budget: lengths in mm, joints from 1. A number that is not finite is
/// unknown, and null.
[[nodiscard]] nlohmann::ordered_json budget_line_json(const BudgetLine& line);
/// `nominal_rms_mm` and `lines`, the largest alone first; lines whose size is not known come last.
[[nodiscard]] nlohmann::ordered_json budget_view_json(const BudgetView& view);

/// `"budget"`: `nominal_rms_mm`, `poses`, `lines` (the largest alone first), `beyond_frames` with
/// the same for the error left after touching base and tool frames, and the first lines in words,
/// those that stand out first (`sentences`). With several sessions also `between_sessions`: the
/// lines of changes, each with `since_session`, at the poses where it acts.
[[nodiscard]] nlohmann::ordered_json budget_json(const ErrorBudget& budget);

/// `"steps"`: the error left after each step and all before it, and the values that the step sets.
[[nodiscard]] nlohmann::ordered_json remedy_steps_json(const ErrorBudget& budget);

}  // namespace trammel
