#pragma once

#include <nlohmann/json.hpp>

#include "server/compensate/budget/budget.h"

namespace trammel {

/// `"budget"`: `nominal_rms_mm`, `poses`, `lines` (the largest alone first), `beyond_frames` with
/// the same of what is left when base and tool frames were touched, and the first lines in words,
/// what stands out first (`sentences`).
[[nodiscard]] nlohmann::ordered_json budget_json(const ErrorBudget& budget);

/// `"steps"`: what is left when each step and all before it are done, and the values that it sets.
[[nodiscard]] nlohmann::ordered_json remedy_steps_json(const ErrorBudget& budget);

}  // namespace trammel
