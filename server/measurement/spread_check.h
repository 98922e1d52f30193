#pragma once

#include <string>

#include "server/base/result.h"
#include "server/measurement/measurement.h"

namespace trammel {

/// Refuses a batch whose measured positions spread over far more or far less than the nominal robot moves its tool
/// between the commanded joints: joints in radians, positions in metres. Spread is the rms distance from the centroid,
/// which neither the base nor a few outliers change; an unknown tool may be up to half a metre long.
/// The batch's joints fit the robot and its tools are resolved.
[[nodiscard]] Status check_spread(const MeasurementBatch& batch, const Cell& cell, const std::string& where);

}  // namespace trammel
