#pragma once

#include "server/base/result.h"
#include "server/calibrate/calibration.h"

namespace trammel {

/// Every source must find what it needs (times, temperatures, directions, velocities, a payload) in at least one pose;
/// refuses where one does not.
[[nodiscard]] Status check_needs(const CalibrationProblem& problem);

}  // namespace trammel
