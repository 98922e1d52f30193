#pragma once

#include <optional>
#include <string>

#include "server/compensate/compensated_model.h"

namespace trammel {

/// Farther than a healthy or changed robot is off: so many times what the model expects, and so
/// many m. Nothing that is beyond both is chance.
inline constexpr double kNeverExpected = 20;
inline constexpr double kNeverOff = 5e-3;

/// Why `batch` (checked against the model's cell, in its world) was not measured of this robot as
/// the model has it, with the reading that would fit, if any (reading_doubt()). Half of the poses
/// must be farther off than that: a few bad ones are no mistake of reading. Empty where they may be
/// this robot's.
[[nodiscard]] std::optional<std::string> foreign_poses(const CompensatedModel& model,
                                                       const MeasurementBatch& batch);

}  // namespace trammel
