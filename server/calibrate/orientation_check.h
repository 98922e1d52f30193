#pragma once

#include <optional>
#include <string>

#include "server/base/result.h"
#include "server/measurement/measurement.h"

/// Whether measured orientations are those of the commanded joints, before anything is identified from them.
///
/// The model: R_WT = R_WB R_BF(q) R_FT, to the few degrees that a nominal chain may be off. R_WB is what the positions
/// say (or the cell), and so R_BF(q)' R_WB' R_WT is one and the same rotation at every pose of a tool: its R_FT. How
/// far the poses scatter about it says whether the orientations follow the joints; how far it stands from the cell's
/// own R_FT, whether they are of another tool frame. The same is asked of the other ways in which the numbers may have
/// been meant (xyzw order, the inverse, the robot's base for the tracker, a joint reversed, rows shifted by one).
///
/// What is identifiable: with one constant orientation and an unknown tool every reading fits as well as any other, and
/// none does harm. Where positions do not tell the base, and are not those of the cell's, base and tool are fitted to
/// the orientations: from four poses that turn about different axes on, another order does not fit.
namespace trammel {

/// What speaks against the orientations of `batch` (checked against `cell`): how far they are off (`value`, deg), the
/// reading that would fit (`text`, `as xyzw`), the first row where not all of them are, and the question that whoever
/// measured them can answer (`next`); nothing where they follow the joints, where fewer than 3 poses of a tool have
/// one, and where the positions do not belong to the joints either.
[[nodiscard]] std::optional<Error> orientation_doubt(const MeasurementBatch& batch, const Cell& cell);

/// Refuses a batch with an orientation_doubt().
[[nodiscard]] Status check_orientations(const MeasurementBatch& batch, const Cell& cell);

}  // namespace trammel
