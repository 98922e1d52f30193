#pragma once

#include "server/robot/chain.h"

namespace trammel {

/// The pose of the flange of a nominal chain, and its velocities.
struct FlangeMotion {
  Pose X_BF;
  /// 6 x n: as Chain::jacobian() of the flange's origin.
  Eigen::Matrix<double, 6, Eigen::Dynamic, 0, 6, kMaxJoints> jacobian;
};

/// Both in one pass over the links.
[[nodiscard]] FlangeMotion flange_motion(const Chain& chain, const JointVector& q);

}  // namespace trammel
