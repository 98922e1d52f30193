#pragma once

#include <optional>

#include "server/robot/chain.h"

/// The wrist of an arm near the pose at which its last but one axis makes two others parallel.
/// There the flange cannot turn about every direction, and small turns need large motions of the
/// joints.
namespace trammel {

struct WristOpening {
  double angle =
      0;  ///< rad, in [-pi/2, pi/2]; 0 where the two axes are parallel. Its sign tells the branch
  JointVector by_joint;  ///< derivative of `angle` by each commanded joint
  JointVector idle;  ///< unit vector: at `angle` = 0 this motion of the joints leaves the flange at
                     ///< rest
};

/// Empty where the wrist is open wider than `widest` (rad), and where other joints are singular at
/// the same time. Empty also for an arm, rails aside, that has not six turning joints whose axes 4
/// and 5, and 5 and 6, meet or cross at right angles.
[[nodiscard]] std::optional<WristOpening> wrist_opening(const Chain& chain, const JointVector& q,
                                                        double widest);

/// The joints turned along `idle` so that joint 4 comes to `joint_4`. At an angle of 0 the flange
/// stays where it is.
[[nodiscard]] JointVector turned_idly(const Chain& chain, const JointVector& q,
                                      const WristOpening& wrist, double joint_4);

}  // namespace trammel
