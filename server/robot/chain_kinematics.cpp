// Kinematics of the nominal chain: the arm without any error source.
#include "server/robot/arm_state.h"
#include "server/robot/chain.h"
#include "server/robot/flange_motion.h"

namespace trammel {

namespace {

ArmState bare_arm(const Chain& chain, const JointVector& q) {
  ArmState state;
  state.chain = &chain;
  state.links = chain.links_at(q);
  return state;
}

/// The motion of the point `p_F` per turn about each axis.
ArmKinematics::JointJacobian by_axes(const Chain& chain, const JointVector& q, const Vector3& p_F) {
  ArmState state = bare_arm(chain, q);
  state.X_FT.translation() = p_F;
  return ArmKinematics(state).axis_jacobian();
}

}  // namespace

Pose Chain::flange_pose(const JointVector& q) const {
  return ArmKinematics(bare_arm(*this, q)).tool_pose_W();
}

Eigen::MatrixXd Chain::jacobian(const JointVector& q, const Vector3& p_F) const {
  return by_axes(*this, q, p_F) * transmission_;
}

Eigen::MatrixXd Chain::gear_jacobian(const JointVector& q, const Vector3& p_F) const {
  return by_axes(*this, q, p_F) * drive_;
}

FlangeMotion flange_motion(const Chain& chain, const JointVector& q) {
  const ArmKinematics kinematics(bare_arm(chain, q));
  return {kinematics.tool_pose_W(), kinematics.axis_jacobian() * chain.transmission()};
}

}  // namespace trammel
