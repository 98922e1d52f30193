#pragma once

#include "server/error_sources/physical_model.h"
#include "server/measurement/measurement.h"

namespace trammel {

/// Where a refit starts from: base and tools of `batch`, as the arm of `before`, errors and all, leads to its poses,
/// written into `model`. `base`, `tool`: which of them are anew; `model` has their sources, at their priors. Refuses
/// poses that do not tell them: a base takes three positions that are not on one line, or an orientation; with a tool
/// that nobody knows besides, the flange must turn.
[[nodiscard]] Status locate_refitted_frames(const PhysicalModel& before, const MeasurementBatch& batch, bool base,
                                            bool tool, PhysicalModel& model);

}  // namespace trammel
