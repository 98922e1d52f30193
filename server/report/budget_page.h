#pragma once

#include <optional>
#include <string>

#include "server/compensate/budget/budget.h"

namespace trammel {

/// A section of a page: the lines of the budget with their values, steps from the drawing to the
/// whole error, shares, and what to do. Says so where there is none.
[[nodiscard]] std::string budget_section(const std::optional<ErrorBudget>& budget);

/// The value of a line with its U and unit, as HTML; empty where it has none.
[[nodiscard]] std::string value_html(const BudgetLine& line);

/// A bar of `share` (0 to 1) of its place, as pages may have it (page_policy.h): without a style of
/// its own.
[[nodiscard]] std::string bar_of(double share, const char* kind);

}  // namespace trammel
