#pragma once

#include "server/error_sources/physical_model.h"
#include "server/measurement/measurement.h"

namespace trammel {

/// Places base and tools of `batch` in `model` as the start of a refit, using the arm of `before`
/// with all its errors. `base` and `tool` say which of the frames are new; `model` has their
/// sources at the priors. Refuses poses that do not determine the frames: a base needs three
/// positions that are not on one line, or an orientation. If a tool is unknown as well, the flange
/// must turn.
[[nodiscard]] Status locate_refitted_frames(const PhysicalModel& before,
                                            const MeasurementBatch& batch, bool base, bool tool,
                                            PhysicalModel& model);

}  // namespace trammel
