#pragma once

#include "server/bias/bias_model.h"
#include "server/error_sources/physical_model.h"
#include "server/measurement/measurement.h"

namespace trammel {

/// The residual of `physics` at the measured positions, in B. A bias is learned from it.
[[nodiscard]] BiasProblem leftover(const PhysicalModel& physics, const MeasurementBatch& batch);

}  // namespace trammel
