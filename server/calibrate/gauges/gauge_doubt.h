#pragma once

#include <optional>

#include "server/base/result.h"
#include "server/measurement/measurement.h"

namespace trammel {

/// Reasons not to learn from the distances and touches of `batch` (checked against `cell`):
/// they are in another unit, all of them or some rows, or touches count the other way. Distances
/// are asked of the arm as drawn, which is some mm off where they are metres; touches, which are
/// mm, of the arm that they themselves show. Empty where they follow the joints, or where no other
/// reading fits much better.
[[nodiscard]] std::optional<Error> gauge_doubt(const MeasurementBatch& batch, const Cell& cell);

}  // namespace trammel
