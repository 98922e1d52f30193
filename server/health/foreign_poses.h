#pragma once

#include <optional>
#include <string>

#include "server/compensate/compensated_model.h"

namespace trammel {

/// Limits for a robot, healthy or changed: a multiple of the model's expectation, and a distance in
/// m. A deviation beyond both is not chance.
inline constexpr double kNeverExpected = 20;
inline constexpr double kNeverOff = 5e-3;

/// The reason why `batch` (checked against the model's cell, in its world) cannot be of this robot
/// as the model has it, with the reading that would fit, if any (reading_doubt()). Half of the
/// poses must exceed the limits above, since a few bad poses are not a mistake of reading. Empty if
/// they may be this robot's.
[[nodiscard]] std::optional<std::string> foreign_poses(const CompensatedModel& model,
                                                       const MeasurementBatch& batch);

}  // namespace trammel
