#pragma once

#include <string>

#include "server/compensate/compensated_model.h"

namespace trammel {

/// Refuses a model that the cell cannot be served with: of another robot (its kinematics count,
/// names and priors do not), or trained with tools or payloads that are not what the cell says they
/// are. `which` names it.
[[nodiscard]] Status check_fits_cell(const CompensatedModel& model, const Cell& cell,
                                     const std::string& which);
/// Refuses two models that are not of one robot with the same tools. Their payloads may differ:
/// each predicts with its own.
[[nodiscard]] Status check_comparable(const CompensatedModel& before, const CompensatedModel& now);

}  // namespace trammel
