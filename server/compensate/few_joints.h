#pragma once

#include "server/compensate/joint_steps.h"
#include "server/robot/inverse_kinematics.h"

/// Arms with fewer than six joints, such as a SCARA, can bring the tool's point to its target, but
/// cannot turn the tool in every way. Here the point has priority: it reaches its target, and the
/// tool is turned as nearly as the arm can.
namespace trammel {

[[nodiscard]] bool has_few_joints(const Chain& robot);

/// Nominal joints near `seed` that bring the tool to `X_BT`, like inverse_kinematics().
/// kUnreachable: the point is out of reach, or the orientation would be off by more than 0.01 deg,
/// which is more than the rounding of a target.
[[nodiscard]] InverseResult inverse_kinematics_of_few(const Chain& robot, const Pose& X_BT,
                                                      const Pose& X_FT, const JointVector& seed);

/// From the joints `start`, where `missing_at_start` is missing.
[[nodiscard]] CorrectedJoints correct_few_joints(const Chain& robot, const Pose& X_FT,
                                                 const JointVector& start,
                                                 const Vector6& missing_at_start,
                                                 const MissingAt& missing_at,
                                                 const CorrectOptions& options);

/// True if these joints, from an inverse_kinematics_of_few() that was kUnreachable, bring the
/// tool's point to its target.
[[nodiscard]] bool point_is_reached(const Chain& robot, const Pose& X_BT, const Pose& X_FT,
                                    const JointVector& q);

}  // namespace trammel
