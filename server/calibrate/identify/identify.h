#pragma once

#include "server/base/result.h"
#include "server/calibrate/calibration.h"

namespace trammel {

/// Minimises and estimates the discrepancy in turns until neither changes, then adds how well every
/// parameter is known. Sources, frames and orders are as the model has them. Refuses where the
/// solver fails, and joints that do not lead to the positions.
[[nodiscard]] Result<CalibrationResult> identify(const CalibrationProblem& problem,
                                                 const CalibrateOptions& options);

}  // namespace trammel
