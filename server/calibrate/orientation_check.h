#pragma once

#include <optional>
#include <string>

#include "server/base/result.h"
#include "server/measurement/measurement.h"

/// Checks that the measured orientations belong to the commanded joints, before anything is
/// identified from them.
///
/// The model is R_WT = R_WB R_BF(q) R_FT, to the few degrees that a nominal chain may be off. R_WB
/// comes from the positions or from the cell. Then R_BF(q)' R_WB' R_WT is the same rotation at
/// every pose of a tool: its R_FT. The scatter of the poses about it tells whether the orientations
/// follow the joints. Its distance from the cell's R_FT tells whether they are of another tool
/// frame. The same test is made for other readings of the numbers: xyzw order, the inverse, the
/// robot's base instead of the tracker, a joint reversed, rows shifted by one, the three angles of
/// the file in radians, in another order or as a rotation vector.
///
/// With one constant orientation and an unknown tool all readings fit equally well, and none does
/// harm. If the positions neither determine the base nor fit the cell's base, base and tool are
/// fitted to the orientations. With four or more poses that turn about different axes, a wrong
/// order does not fit.
namespace trammel {

/// The reason against the orientations of `batch` (checked against `cell`). It has the deviation
/// (`value`, deg), the reading that would fit (`text`, `as xyzw`), the first bad row if only some
/// are bad, and a question to whoever measured them (`next`). Empty if the orientations follow the
/// joints, if fewer than 3 poses of a tool have one, or if the positions do not belong to the
/// joints either. `X_WB`: the base, if a better value than that of these positions is known.
[[nodiscard]] std::optional<Error> orientation_doubt(const MeasurementBatch& batch,
                                                     const Cell& cell,
                                                     const std::optional<Pose>& X_WB = {});

/// Refuses a batch with an orientation_doubt().
[[nodiscard]] Status check_orientations(const MeasurementBatch& batch, const Cell& cell);

}  // namespace trammel
