#pragma once

#include "server/bias/bias_model.h"
#include "server/error_sources/physical_model.h"
#include "server/measurement/measurement.h"

namespace trammel {

/// What `physics` leaves over of the measured positions, in B: what a bias is learned from.
[[nodiscard]] BiasProblem leftover(const PhysicalModel& physics, const MeasurementBatch& batch);

}  // namespace trammel
