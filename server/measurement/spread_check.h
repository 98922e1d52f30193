#pragma once

#include <string>

#include "server/base/result.h"
#include "server/measurement/measurement.h"

namespace trammel {

/// Refuses a batch whose measured positions spread far more or far less than the nominal tool
/// positions at the commanded joints. This finds joints in radians and positions in metres. Spread
/// is the rms distance from the centroid; neither the base nor a few outliers change it much. An
/// unknown tool may be up to half a metre long. Requires joints that match the robot and resolved
/// tools.
[[nodiscard]] Status check_spread(const MeasurementBatch& batch, const Cell& cell,
                                  const std::string& where);

}  // namespace trammel
