#pragma once

#include <string>

#include "server/plan/plan.h"
#include "server/robot/cell.h"

namespace trammel::cli {

/// The poses of a plan as a joint list (CSV). `where` names it in the errors of its readers.
[[nodiscard]] std::string plan_csv(const Cell& cell, const std::string& where, const Plan& plan);

}  // namespace trammel::cli
