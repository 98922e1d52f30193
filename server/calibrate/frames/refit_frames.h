#pragma once

#include "server/error_sources/physical_model.h"
#include "server/measurement/measurement.h"

namespace trammel {

/// Writes into `model` where base and tools of `batch` are, found with the arm of `before` and all
/// its errors: a refit starts there. `base`, `tool`: which of them are anew; `model` has their
/// sources, at the priors. Refuses poses that do not determine them: a base needs three positions
/// that are not on one line, or an orientation. With an unknown tool as well, the flange must turn.
[[nodiscard]] Status locate_refitted_frames(const PhysicalModel& before,
                                            const MeasurementBatch& batch, bool base, bool tool,
                                            PhysicalModel& model);

}  // namespace trammel
