#pragma once

#include <string>
#include <vector>

#include "server/plan/plan.h"
#include "server/simulate/simulate.h"
#include "server/tasks/train/train.h"

/// How well a model states its errors beyond its training poses.
namespace trammel::test {

/// Poses whose farthest joint is between `from` and `to` of its training range out of range.
struct OutsideBand {
  double from = 0, to = 0;
  int poses = 0;
  double rms = 0;                   ///< m, of one coordinate's error, as served
  double stddev = 0;                ///< m, as claimed, rms
  double coverage_95 = 0;           ///< share of coordinates inside their interval
  double rotation_coverage_95 = 0;  ///< of rotation vectors likewise; 0 where none was learned
};

struct OutsideFigures {
  std::vector<OutsideBand> bands;  ///< the first is within range
  /// An outsider is a pose at which the whole bias errs by more than three times the rms of
  /// left-out training poses. An insider is within the training ranges and not an outsider.
  int outsiders = 0, caught = 0;  ///< caught: not in domain
  int insiders = 0, refused = 0;  ///< refused: not in domain either
};

/// `poses` poses of a Latin hypercube, measured by the cell's tracker.
[[nodiscard]] MeasurementBatch measured_within(const VirtualRobot& robot, const JointRanges& ranges,
                                               int poses, std::uint64_t seed);
/// A model of `level` and `bias` trained on `training_poses` within `ranges`, asked there and at
/// growing distances up to the cell's joint ranges; the poses of all seeds 1..`seeds` together.
[[nodiscard]] OutsideFigures asked_outside(const VirtualRobot& robot, const JointRanges& ranges,
                                           const std::string& level, const std::string& bias,
                                           int training_poses, int seeds);

}  // namespace trammel::test
