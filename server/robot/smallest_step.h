#pragma once

#include <vector>

#include "server/base/result.h"
#include "server/robot/cell.h"

namespace trammel {

/// The radius that holds 95 % of a deviation with this rms that is spread alike in all directions:
/// sqrt(7.815 / 3), chi-square of three.
constexpr double kRadiusOfRms = 1.614;

/// How finely an arm moves, as its maker says it in the robot file.
struct ArmSteps {
  double repeatability = 0;  ///< m, RP of ISO 9283; 0: not told
  std::vector<double> encoders =
      {};  ///< rad (m), step of each joint's commanded value; 0: not told

  /// m: no smaller radius about a place of the point `p_F` (m, in F) is promised. The
  /// repeatability, or what the encoders leave open where that is more: each joint stands anywhere
  /// within its step, so its angle has the deviation step / sqrt(12), and the radius is
  /// kRadiusOfRms times what these make. 0: the robot file tells neither.
  [[nodiscard]] double smallest(const Chain& robot, const JointVector& q, const Vector3& p_F) const;
};
/// Nothing of a cell without a robot file.
[[nodiscard]] Result<ArmSteps> steps_of(const Cell& cell);

}  // namespace trammel
