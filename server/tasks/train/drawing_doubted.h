#pragma once

#include <optional>
#include <string>

#include "server/error_sources/physical_model.h"
#include "server/measurement/measurement.h"

namespace trammel {

/// What stops a model of `rows` because its robot file cannot be this robot's, in words. It is
/// asked of the geometry that the standard sources find in the same rows, since `physics`
/// identifies none: what a bias learns instead fits the positions and moves corrected poses by the
/// error of the file. Empty where `physics` identifies the geometry itself, and where the rows do
/// not determine it.
[[nodiscard]] std::optional<std::string> drawing_doubted(const PhysicalModel& physics,
                                                         const MeasurementBatch& rows);

}  // namespace trammel
