#pragma once

#include <optional>
#include <string>

#include "server/compensate/budget/budget.h"

namespace trammel {

/// A section of a page: the lines of the budget with their values, steps from the drawing to the
/// whole error, shares, and repairs. Without a budget it says so.
[[nodiscard]] std::string budget_section(const std::optional<ErrorBudget>& budget);

/// The value of a line with its U and unit, as HTML; empty where it has none.
[[nodiscard]] std::string value_html(const BudgetLine& line);

/// A bar that fills `share` (0 to 1) of its place, without a style of its own, as pages require
/// (page_policy.h).
[[nodiscard]] std::string bar_of(double share, const char* kind);

}  // namespace trammel
