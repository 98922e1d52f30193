#pragma once

#include "server/calibrate/calibration.h"

namespace trammel {

/// The number of motions of the base, of 6, that leave all readings as they are: gauges to anchors
/// whose places are unknown tell none of them, one known point leaves the turns about it, two those
/// about the line through them.
[[nodiscard]] int untold_motions(const PhysicalModel& model, const MeasurementBatch& batch);

/// Adds to `found`, identified on gauges of `batch`, what such a campaign cannot know, in words:
/// where the base stands, and, of a stroke that is short beside its length, the size of the robot.
void add_campaign_limits(const MeasurementBatch& batch, CalibrationResult& found);

}  // namespace trammel
