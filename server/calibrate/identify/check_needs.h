#pragma once

#include "server/base/result.h"
#include "server/calibrate/calibration.h"

namespace trammel {

/// Refuses a source that needs a quantity no pose has: a time, a temperature, an approach
/// direction, a velocity, a payload.
[[nodiscard]] Status check_needs(const CalibrationProblem& problem);

}  // namespace trammel
