#pragma once

#include <optional>

#include "server/base/result.h"
#include "server/measurement/measurement.h"

namespace trammel {

/// The reason not to learn from the distances and touches of `batch` (checked against `cell`), if
/// there is one: all rows, those to one anchor or some rows are in another unit; an anchor stands
/// elsewhere than the cell file says, as if a sign, two coordinates or the unit of its place were
/// wrong, while another anchor is in its stated place; or touches have the opposite sign. Distances
/// to anchors and between poses are long, so they are compared with the arm as drawn, which is off
/// by a few mm. Touches are millimetres, so they are compared with the arm that they themselves
/// identify. Empty if they follow the joints, or if no other reading fits much better.
[[nodiscard]] std::optional<Error> gauge_doubt(const MeasurementBatch& batch, const Cell& cell);

}  // namespace trammel
