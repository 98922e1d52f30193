#pragma once

#include "server/calibrate/calibration.h"

namespace trammel {

/// The number of motions of the base, out of 6, that change no reading. Gauges to anchors with
/// unknown places leave all 6. One known point leaves the turns about it, and two points leave the
/// turn about the line through them.
[[nodiscard]] int untold_motions(const PhysicalModel& model, const MeasurementBatch& batch);

/// Adds to `found`, identified on gauges of `batch`, the limits of such a campaign in words: the
/// place of the base and, if the stroke is short beside the instrument's length or nothing is a
/// length, the size of the robot.
void add_campaign_limits(const MeasurementBatch& batch, CalibrationResult& found);

}  // namespace trammel
