#pragma once

#include "server/measurement/measurement.h"

namespace trammel {

/// Fills the previous pose and lagged temperatures of each measurement, session by session; clears
/// them if they are unknown. Needs the time of every row of the session, in the order of the rows.
///
/// Sets PoseContext::before to the joints of the row before. It stays unknown for the first row, on
/// a continuous path (which has velocities), and where a recorded side of a gear of `robot`
/// contradicts the row before.
///
/// PoseContext::lagged is the temperature of bodies that follow the recorded one with each of
/// kHeatLags (first order). It also needs the temperature of every row. The temperature is assumed
/// to change evenly between rows, and to be constant before the first row.
void fill_history(MeasurementBatch& batch, const Chain& robot);

}  // namespace trammel
