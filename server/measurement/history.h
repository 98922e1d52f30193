#pragma once

#include "server/measurement/measurement.h"

namespace trammel {

/// Fills what came before each measurement, session by session; clears it where it is not known.
/// Needs the time of every row of the session, in the order of the rows.
///
/// Sets PoseContext::before to the joints of the row before. It stays unknown for the first row, on
/// a continuous path (which has velocities), and where a recorded side of a gear of `robot`
/// contradicts the row before.
///
/// PoseContext::lagged is the temperature as a body feels it that follows by each of kHeatLags
/// (first order). Needs the temperature of every row as well. Between rows it is taken to change
/// evenly; before the first one it has stood still.
void fill_history(MeasurementBatch& batch, const Chain& robot);

}  // namespace trammel
