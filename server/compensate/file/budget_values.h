#pragma once

#include "server/compensate/budget/budget.h"
#include "server/compensate/file/json_values.h"

namespace trammel::model_file {

/// An error budget as a model file holds it, lengths in m.
[[nodiscard]] Json budget_json(const ErrorBudget& budget);
/// Its inverse. Throws exceptions of nlohmann.
[[nodiscard]] ErrorBudget budget_from(const Json& json);

}  // namespace trammel::model_file
