#pragma once

#include <optional>

#include "server/base/result.h"
#include "server/measurement/measurement.h"

namespace trammel {

/// The reason not to learn from `batch` (checked against `cell`), if there is one. Positions and
/// orientations may have been misread (look_at_readings(), orientation_doubt()) or belong to
/// another tool; the error then states the interpretation that fits. Distances and touches are
/// judged by gauge_doubt(). Every check of a batch before learning calls this.
[[nodiscard]] std::optional<Error> batch_doubt(const MeasurementBatch& batch, const Cell& cell);

/// batch_doubt() without doubts about the tool, for a batch whose tool a model in force can judge
/// better. It also doubts positions that were computed from the drawing, since such a model would
/// take them for a change of its arm.
[[nodiscard]] std::optional<Error> reading_doubt(const MeasurementBatch& batch, const Cell& cell);

/// Refuses a batch with a batch_doubt().
[[nodiscard]] Status check_batch(const MeasurementBatch& batch, const Cell& cell);

}  // namespace trammel
