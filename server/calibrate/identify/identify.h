#pragma once

#include "server/base/result.h"
#include "server/calibrate/calibration.h"

namespace trammel {

/// Alternates minimising and estimating the discrepancy until neither changes, then adds the
/// uncertainty of every parameter. Sources, frames and orders are those of the model. Refuses if
/// the solver fails, and joints that do not lead to the positions.
[[nodiscard]] Result<CalibrationResult> identify(const CalibrationProblem& problem,
                                                 const CalibrateOptions& options);

}  // namespace trammel
