#pragma once

#include <nlohmann/json.hpp>

#include "server/compensate/budget/budget.h"

namespace trammel {

/// `"budget"`: `nominal_rms_mm`, `poses`, `lines`, `remedies` (what is left, one after the other) and `beyond_frames`
/// with the same of what is left when base and tool frames were touched, and the first lines in words (`sentences`).
[[nodiscard]] nlohmann::ordered_json budget_json(const ErrorBudget& budget);

}  // namespace trammel
