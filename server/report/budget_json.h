#pragma once

#include <nlohmann/json.hpp>

#include "server/compensate/budget/budget.h"

namespace trammel {

/// A line, in the shape that every budget has: lengths in mm, joints from 1. A number that is not
/// finite is not known, and null.
[[nodiscard]] nlohmann::ordered_json budget_line_json(const BudgetLine& line);
/// `nominal_rms_mm` and `lines`, the largest alone first; lines whose size is not known come last.
[[nodiscard]] nlohmann::ordered_json budget_view_json(const BudgetView& view);

/// `"budget"`: `nominal_rms_mm`, `poses`, `lines` (the largest alone first), `beyond_frames` with
/// the same of what is left when base and tool frames were touched, and the first lines in words,
/// what stands out first (`sentences`). Of several sessions also `between_sessions`: the lines of
/// what changed, each with `since_session`, at the poses where it acts.
[[nodiscard]] nlohmann::ordered_json budget_json(const ErrorBudget& budget);

/// `"steps"`: what is left when each step and all before it are done, and the values that it sets.
[[nodiscard]] nlohmann::ordered_json remedy_steps_json(const ErrorBudget& budget);

}  // namespace trammel
