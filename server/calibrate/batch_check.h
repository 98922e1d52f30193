#pragma once

#include <optional>

#include "server/base/result.h"
#include "server/measurement/measurement.h"

namespace trammel {

/// The reasons against learning from `batch` (checked against `cell`), of positions and
/// orientations: a mistake of reading (look_at_readings(), orientation_doubt()) or another tool,
/// with the figure of what would fit; and against its distances and touches (gauge_doubt()).
/// Whoever looks at a batch before anything is learned asks this.
[[nodiscard]] std::optional<Error> batch_doubt(const MeasurementBatch& batch, const Cell& cell);

/// batch_doubt() without doubts about the tool, for a batch of which a model in force can judge
/// that better. It doubts also positions that were computed from the drawing, which such a model
/// would take for a change of its arm.
[[nodiscard]] std::optional<Error> reading_doubt(const MeasurementBatch& batch, const Cell& cell);

/// Refuses a batch with a batch_doubt().
[[nodiscard]] Status check_batch(const MeasurementBatch& batch, const Cell& cell);

}  // namespace trammel
