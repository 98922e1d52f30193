#pragma once

#include <optional>
#include <string>

#include "server/base/result.h"
#include "server/measurement/measurement.h"

/// Checks that the measured orientations belong to the commanded joints, asked before anything is
/// identified from them.
///
/// The model is R_WT = R_WB R_BF(q) R_FT, to the few degrees that a nominal chain may be off. R_WB
/// comes from the positions or from the cell. Then R_BF(q)' R_WB' R_WT is the same rotation at
/// every pose of a tool: its R_FT. The scatter of the poses about it tells whether the orientations
/// follow the joints. Its distance from the cell's R_FT tells whether they are of another tool
/// frame. The same is asked of other ways in which the numbers may have been meant: xyzw order, the
/// inverse, the robot's base instead of the tracker, a joint reversed, rows shifted by one, the
/// three angles of the file in radians, in another order or as a rotation vector.
///
/// With one constant orientation and an unknown tool all readings fit equally well, and none does
/// harm. Where the positions do not tell the base and do not fit that of the cell, base and tool
/// are fitted to the orientations: from four poses on that turn about different axes, another order
/// does not fit.
namespace trammel {

/// Reasons against the orientations of `batch` (checked against `cell`): how far they are off
/// (`value`, deg), the reading that would fit (`text`, `as xyzw`), the first row where not all of
/// them are, and the question that whoever measured them can answer (`next`); nothing where they
/// follow the joints, where fewer than 3 poses of a tool have one, and where the positions do not
/// belong to the joints either. `X_WB`: where the base stands, if that is known better than these
/// positions say.
[[nodiscard]] std::optional<Error> orientation_doubt(const MeasurementBatch& batch,
                                                     const Cell& cell,
                                                     const std::optional<Pose>& X_WB = {});

/// Refuses a batch with an orientation_doubt().
[[nodiscard]] Status check_orientations(const MeasurementBatch& batch, const Cell& cell);

}  // namespace trammel
