#pragma once

#include "server/compensate/compensated_model.h"

namespace trammel {

/// Share of the measured numbers (coordinates in B, distances, touches) that are predicted to within the 95 % interval
/// of the stated sigma alone. A coverage of intervals that were widened until they held shows nothing; this one shows
/// whether the model is as good as the instrument.
[[nodiscard]] double stated_coverage(const CompensatedModel& model, const MeasurementBatch& batch);

}  // namespace trammel
