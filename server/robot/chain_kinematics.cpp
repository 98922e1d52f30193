// Kinematics of the nominal chain: the arm without any error source.
#include "server/robot/arm_state.h"
#include "server/robot/chain.h"

namespace trammel {

namespace {

ArmState bare_arm(const Chain& chain, const JointVector& q) {
  ArmState state;
  state.chain = &chain;
  state.links = chain.links_at(q);
  return state;
}

}  // namespace

Pose Chain::flange_pose(const JointVector& q) const { return ArmKinematics(bare_arm(*this, q)).tool_pose_W(); }

Eigen::MatrixXd Chain::jacobian(const JointVector& q, const Vector3& p_F) const {
  ArmState state = bare_arm(*this, q);
  state.X_FT.translation() = p_F;
  const StateMatrix<6> all = ArmKinematics(state).pose_jacobian();
  const StateRows rows(size());
  Eigen::MatrixXd per_joint(6, size());
  for (int i = 0; i < size(); ++i) {
    per_joint.col(i) = all.col(joint(i).type == JointType::kRevolute ? rows.theta(i) : rows.d(i));
  }
  return per_joint * transmission_;
}

}  // namespace trammel
