#pragma once

#include "clients/cam/correct_program.h"
#include "server/compensate/compensated_model.h"

namespace trammel::cli {

/// The play and hysteresis that a model knows. Targets within `tolerance_mm` (0: the cell's
/// tolerance) with 95 % need no approach point. Refuses if neither states a tolerance.
[[nodiscard]] Result<cam::LeadInOptions> lead_in_options(const CompensatedModel& model,
                                                         double tolerance_mm);

}  // namespace trammel::cli
