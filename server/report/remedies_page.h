#pragma once

#include <string>

#include "server/compensate/budget/budget.h"
#include "server/compensate/compensated_model.h"

namespace trammel {

/// The repairs that a shop can make, their places, and the error left after each, as a page for the
/// wall. `where`: the poses of the figures.
[[nodiscard]] std::string remedies_page(const CompensatedModel& model, const ErrorBudget& budget,
                                        const std::string& where);

}  // namespace trammel
