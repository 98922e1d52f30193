#pragma once

#include <optional>
#include <string>

#include "server/compensate/budget/budget.h"

namespace trammel {

/// A section of a page: the lines of the budget with their values, bars of what each does alone, shares, and what to
/// do. Says so where there is none.
[[nodiscard]] std::string budget_section(const std::optional<ErrorBudget>& budget);

}  // namespace trammel
