#pragma once

#include "clients/cam/correct_program.h"
#include "server/compensate/compensated_model.h"

namespace trammel::cli {

/// The play and hysteresis that a model knows; no approach point is needed by targets that
/// are within `tolerance_mm`, 0: the cell's, with 95 %. Refuses where neither says a tolerance.
[[nodiscard]] Result<cam::LeadInOptions> lead_in_options(const CompensatedModel& model,
                                                         double tolerance_mm);

}  // namespace trammel::cli
