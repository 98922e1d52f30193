#pragma once

#include <optional>
#include <string>

#include "server/base/result.h"
#include "server/measurement/measurement.h"

/// The check whether the measured positions belong to the commanded joints, made before anything is
/// learned from them.
///
/// Only the drawing of the robot is known. So the check fits an arm with wide priors: base free,
/// zeros off by degrees, links and tool by millimetres, compliant gears. A good batch fits it to a
/// millimetre, even if the robot was badly mastered. Misread numbers do not fit, except in the
/// reading in which they were meant: rows shifted against joints, two columns exchanged, another
/// sign, unit or zero in one of them, mirrored axes, another point of the tool, a robot file in
/// another convention.
///
/// Some mistakes cannot be found. Positions alone, from a tracker that may stand anywhere, do not
/// show which of three axes is mirrored, or that two of them were exchanged instead. A turned joint
/// 1 equals a turned base. A mistake in a joint that moves the measured point by less than a
/// millimetre is harmless for positions. A mirrored axis equals a mirrored drawing (several joints
/// of the other sign). Single rows count as outliers, not as mistakes of reading, unless their unit
/// of length differs from the others'. Rows that follow each other at the same joints with places
/// far apart are several reflectors under one name.
namespace trammel {

/// The doubts about how a batch was read.
struct ReadingLook {
  /// The doubt about the positions: their misfit (`value`, mm), the reading that would fit (`text`,
  /// `with q2_deg and q3_deg exchanged`), its columns and the first row concerned. Empty if the
  /// positions follow the joints, if no other reading fits much better, or with fewer than 6 poses.
  std::optional<Error> doubt;
  /// true: the doubt concerns another tool, another point of it or another place of the base, not a
  /// mistake of reading.
  bool of_tool = false;
  JointVector zeros;  ///< rad (m), of each joint: its zero by the positions; 0 if they do not
                      ///< determine it
  /// m: the distance of the positions from the drawing itself, with base and unknown tools at their
  /// best fit; for the best seven of ten positions. Negative: fewer than 6 poses.
  double off_drawing = -1;
  /// The base by the positions, if they determine its orientation to a degree.
  std::optional<Pose> X_WB;
};
/// The cell knows the tools of the batch.
[[nodiscard]] ReadingLook look_at_readings(const MeasurementBatch& batch, const Cell& cell);

/// `failed`, why the numbers of `batch` cannot be those of `cell`, with the reading under which
/// they would be, if any.
[[nodiscard]] Error with_likely_reading(Error failed, const MeasurementBatch& batch,
                                        const Cell& cell);

}  // namespace trammel
