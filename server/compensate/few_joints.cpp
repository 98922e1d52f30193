#include "server/compensate/few_joints.h"

#include "server/base/units.h"

namespace trammel {

namespace {

constexpr int kFree = 6;                // ways to move a tool
constexpr double kPointReached = 1e-9;  // m
constexpr int kMaxIterations = 50;      // of the nominal joints
const double kTurnLeft = from_deg(0.01);

/// Moves the point by the missing distance, and turns the tool as closely to the missing turn as
/// possible.
JointStep point_first(const Chain& robot, const Vector3& p_FT) {
  return [&robot, p_FT](const JointVector& q, const JointVector& /*so_far*/,
                        const Vector6& missing) -> JointVector {
    const Eigen::MatrixXd J = robot.jacobian(q, p_FT);
    const Eigen::MatrixXd turn = J.bottomRows<3>();
    return least_with_held(turn.transpose() * turn, turn.transpose() * missing.tail<3>(),
                           J.topRows<3>(), missing.head<3>());
  };
}

Vector6 nominally_missing(const Chain& robot, const Pose& X_BT, const Pose& X_FT,
                          const JointVector& q) {
  return pose_difference(X_BT, robot.flange_pose(q) * X_FT);
}

}  // namespace

bool has_few_joints(const Chain& robot) { return robot.size() < kFree; }

InverseResult inverse_kinematics_of_few(const Chain& robot, const Pose& X_BT, const Pose& X_FT,
                                        const JointVector& seed) {
  const InverseResult near = inverse_kinematics(robot, X_BT * X_FT.inverse(), seed);
  if (near.status != InverseStatus::kUnreachable) return near;
  const auto missing_at = [&](const JointVector& q, bool /*anew*/) {
    return nominally_missing(robot, X_BT, X_FT, q);
  };
  const CorrectedJoints found =
      settle_joints(near.q, missing_at(near.q, true), point_first(robot, X_FT.translation()),
                    missing_at, kPointReached, kMaxIterations);
  const int iterations = near.iterations + found.iterations;
  if (!found.settled) return {InverseStatus::kUnreachable, near.q, iterations};
  if (found.missing.tail<3>().norm() > kTurnLeft)
    return {InverseStatus::kUnreachable, found.q, iterations};
  return judged_joints(robot, found.q, iterations);
}

CorrectedJoints correct_few_joints(const Chain& robot, const Pose& X_FT, const JointVector& start,
                                   const Vector6& missing_at_start, const MissingAt& missing_at,
                                   const CorrectOptions& options) {
  return settle_joints(start, missing_at_start, point_first(robot, X_FT.translation()), missing_at,
                       options.tolerance, options.max_iterations);
}

bool point_is_reached(const Chain& robot, const Pose& X_BT, const Pose& X_FT,
                      const JointVector& q) {
  return nominally_missing(robot, X_BT, X_FT, q).head<3>().norm() < kPointReached;
}

}  // namespace trammel
