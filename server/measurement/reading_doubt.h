#pragma once

#include <optional>
#include <string>

#include "server/base/result.h"
#include "server/measurement/measurement.h"

/// The check whether the measured positions belong to the commanded joints, made before anything is
/// learned from them.
///
/// Nothing is known of the robot but its drawing. So an arm is fitted that may be anything a robot
/// can be: base free, zeros off by degrees, links and tool by millimetres, gears that give way. A
/// good batch fits it to a millimetre, however badly the robot was mastered. Numbers that were read
/// wrongly do not, and fit in the one way in which they were meant: rows shifted against joints,
/// two columns exchanged, another sign, unit or zero in one of them, mirrored axes, another point
/// of the tool, a robot file in another convention.
///
/// Some mistakes cannot be told: of positions alone from a tracker that may stand anywhere, which
/// of three axes is mirrored, and that two of them were exchanged instead; a turned joint 1, which
/// is a turned base; a mistake in a joint that moves the measured point by less than a millimetre,
/// which does no harm to positions; a mirrored axis from a mirrored drawing (several joints that
/// count the other way). Single rows are outliers, not mistakes of reading, but for those that are
/// in another unit of length than the others. Rows that follow each other at the same joints and
/// tell places far apart are several reflectors under one name.
namespace trammel {

/// The doubts about how a batch was read.
struct ReadingLook {
  /// The doubt about the positions: how far they are off (`value`, mm), the reading that would
  /// fit (`text`, `with q2_deg and q3_deg exchanged`), its columns and the first row that it is
  /// about. Empty where they follow the joints, where no other reading fits much better, and of
  /// fewer than 6 poses.
  std::optional<Error> doubt;
  /// The doubt is of another tool, another point of it or another place of the base, and of no
  /// mistake of reading.
  bool of_tool = false;
  JointVector zeros;  ///< rad (m), of each joint: where the positions put its zero; 0 where they do
                      ///< not tell
  /// m: how far the positions are off the drawing itself, base and unknown tools wherever they fit
  /// best; of the seven of ten that fit best. Negative: fewer than 6 poses.
  double off_drawing = -1;
  /// Where the base stands by the positions, if they tell to a degree how it is turned.
  std::optional<Pose> X_WB;
};
/// The cell knows the tools of the batch.
[[nodiscard]] ReadingLook look_at_readings(const MeasurementBatch& batch, const Cell& cell);

/// `failed`, why the numbers of `batch` cannot be those of `cell`, with the reading under which
/// they would be, if any.
[[nodiscard]] Error with_likely_reading(Error failed, const MeasurementBatch& batch,
                                        const Cell& cell);

}  // namespace trammel
