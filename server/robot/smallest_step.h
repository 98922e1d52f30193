#pragma once

#include <vector>

#include "server/base/result.h"
#include "server/robot/cell.h"

namespace trammel {

/// The radius that contains 95 % of a deviation with this rms that is equal in all directions:
/// sqrt(7.815 / 3), chi-square with three degrees of freedom.
constexpr double kRadiusOfRms = 1.614;

/// The resolution of an arm's motion, as its maker states it in the robot file.
struct ArmSteps {
  double repeatability = 0;  ///< m, RP of ISO 9283; 0: not stated
  std::vector<double> encoders =
      {};  ///< rad (m), step of each joint's commanded value; 0: not stated

  /// m: the smallest radius about a place of the point `p_F` (m, in F) that may be promised. It is
  /// the larger of the repeatability and the effect of the encoder steps. Each joint is anywhere
  /// within its step, so its angle has the standard deviation step / sqrt(12), and the radius is
  /// kRadiusOfRms times the resulting rms. 0 if the robot file states neither.
  [[nodiscard]] double smallest(const Chain& robot, const JointVector& q, const Vector3& p_F) const;
};
/// Empty for a cell without a robot file.
[[nodiscard]] Result<ArmSteps> steps_of(const Cell& cell);

}  // namespace trammel
