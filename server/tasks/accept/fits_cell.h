#pragma once

#include <string>

#include "server/compensate/compensated_model.h"

namespace trammel {

/// Refuses a model that cannot serve the cell: a model of another robot (its kinematics count,
/// names and priors do not), or one trained with tools or payloads that the cell now describes
/// differently. `which` names the model.
[[nodiscard]] Status check_fits_cell(const CompensatedModel& model, const Cell& cell,
                                     const std::string& which);
/// Refuses two models of different robots or tools. Their payloads may differ, since each predicts
/// with its own.
[[nodiscard]] Status check_comparable(const CompensatedModel& before, const CompensatedModel& now);

}  // namespace trammel
