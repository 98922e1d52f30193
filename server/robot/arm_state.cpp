#include "server/robot/arm_state.h"

#include <cmath>

#include "server/base/check.h"

namespace trammel {

void ArmState::add_to_joint(int joint, double delta) {
  for (int i = 0; i < chain->size(); ++i) {
    LinkGeometry& link = links[static_cast<std::size_t>(i)];
    (chain->joint(i).type == JointType::kRevolute ? link.theta : link.d) += chain->transmission()(i, joint) * delta;
  }
}

void StateJacobian::add_to_joint(int joint, int column, double rate) {
  for (int i = 0; i < chain_->size(); ++i) {
    const int row = chain_->joint(i).type == JointType::kRevolute ? rows.theta(i) : rows.d(i);
    matrix(row, column) += chain_->transmission()(i, joint) * rate;
  }
}

ArmKinematics::ArmKinematics(const ArmState& state)
    : chain_(state.chain), X_WB_(state.X_WB), gravity_W_(state.gravity_W) {
  TRAMMEL_CHECK(chain_ != nullptr && state.links.size() == static_cast<std::size_t>(chain_->size()));
  Pose X = state.X_WB;
  for (int i = 0; i < chain_->size(); ++i) {
    const LinkGeometry& link = state.links[static_cast<std::size_t>(i)];
    z_.push_back(X.linear().col(2));
    p_.push_back(X.translation());
    X.linear() = (X.linear() * Eigen::AngleAxisd(link.theta, Vector3::UnitZ())).eval();
    const Vector3 x = X.linear().col(0);
    X.translation() += z_.back() * link.d + x * link.a;
    X.linear() = (X.linear() * Eigen::AngleAxisd(link.alpha, Vector3::UnitX())).eval();
    x_.push_back(x);
    y_.push_back(X.linear().col(1));
    q_.push_back(X.translation());
    if (link.beta != 0) X.linear() = (X.linear() * Eigen::AngleAxisd(link.beta, Vector3::UnitY())).eval();
  }
  X_WF_ = X;
  X_WT_ = X * state.X_FT;
  kinematic_tip_W_ = X_WT_.translation();
  tip_rotation_W_ = state.tip_W.tail<3>();
  X_WT_.translation() += state.tip_W.head<3>();
  if (!tip_rotation_W_.isZero(0)) {
    X_WT_.linear() = (rotation_exp(tip_rotation_W_) * X_WT_.linear()).eval();
  }
  p_cog_W_ = X * state.payload.p_FoCog_F;
  force_W_ = state.payload.mass * kGravity * gravity_W_;
}

ArmKinematics::Motion ArmKinematics::link_motion(int row) const {
  const auto i = static_cast<std::size_t>(row / 5);
  Motion motion;
  switch (row % 5) {
    case 0:
      motion.w = z_[i];
      motion.origin = p_[i];
      break;
    case 1:
      motion.v = z_[i];
      break;
    case 2:
      motion.v = x_[i];
      break;
    case 3:
      motion.w = x_[i];
      motion.origin = q_[i];
      break;
    default:
      motion.w = y_[i];
      motion.origin = q_[i];
  }
  return motion;
}

Eigen::MatrixXd ArmKinematics::pose_jacobian() const {
  const StateRows rows(chain_->size());
  Eigen::MatrixXd J = Eigen::MatrixXd::Zero(6, rows.size());
  const Vector3& p = kinematic_tip_W_;
  for (int row = 0; row < rows.base(0); ++row) {
    const Motion motion = link_motion(row);
    J.col(row).head<3>() = motion.v + motion.w.cross(p - motion.origin);
    J.col(row).tail<3>() = motion.w;
  }
  J.block<3, 3>(0, rows.base(0)).setIdentity();
  J.block<3, 3>(0, rows.base(3)) = -skew(p - X_WB_.translation());
  J.block<3, 3>(3, rows.base(3)).setIdentity();
  const Matrix3 R_WF = X_WF_.linear();
  J.block<3, 3>(0, rows.tool(0)) = R_WF;
  J.block<3, 3>(0, rows.tool(3)) = -skew(p - X_WF_.translation()) * R_WF;
  J.block<3, 3>(3, rows.tool(3)) = R_WF;
  // R_WT = exp(tip) R_kinematic.
  if (!tip_rotation_W_.isZero(0)) J.bottomRows<3>() = (rotation_exp(tip_rotation_W_) * J.bottomRows<3>()).eval();
  J.block<3, 3>(0, rows.tip(0)).setIdentity();
  J.block<3, 3>(3, rows.tip(3)) = left_jacobian(tip_rotation_W_);
  return J;
}

Eigen::MatrixXd ArmKinematics::deflection_jacobian() const {
  Eigen::MatrixXd J = Eigen::MatrixXd::Zero(6, chain_->size());
  for (int j = 0; j < chain_->size(); ++j) {
    const auto k = static_cast<std::size_t>(j);
    if (chain_->joint(j).type == JointType::kRevolute) {
      J.col(j).head<3>() = z_[k].cross(kinematic_tip_W_ - p_[k]);
      J.col(j).tail<3>() = z_[k];
    } else {
      J.col(j).head<3>() = z_[k];
    }
  }
  return J;
}

Eigen::MatrixXd ArmKinematics::deflection_jacobian_derivative(const Eigen::VectorXd& deflection) const {
  const StateRows rows(chain_->size());
  const Eigen::MatrixXd J = deflection_jacobian();
  Eigen::MatrixXd D = Eigen::MatrixXd::Zero(6, rows.size());
  const auto turn = [&](int row, int joint, const Vector3& w) {  // the joint's whole column turns with what is upstream
    D.col(row).head<3>() += deflection(joint) * w.cross(J.col(joint).head<3>());
    D.col(row).tail<3>() += deflection(joint) * w.cross(J.col(joint).tail<3>());
  };
  const auto shift = [&](int row, int joint, const Vector3& tip_motion) {  // only its lever changes
    D.col(row).head<3>() += deflection(joint) * J.col(joint).tail<3>().cross(tip_motion);
  };
  for (int j = 0; j < chain_->size(); ++j) {
    for (int row = 0; row < rows.base(0); ++row) {
      const Motion motion = link_motion(row);
      if (row / 5 < j) {
        turn(row, j, motion.w);
      } else {
        shift(row, j, motion.v + motion.w.cross(kinematic_tip_W_ - motion.origin));
      }
    }
    for (int axis = 0; axis < 3; ++axis) {
      turn(rows.base(3 + axis), j, Vector3::Unit(axis));
      shift(rows.tool(axis), j, X_WF_.linear().col(axis));
      shift(rows.tool(3 + axis), j, X_WF_.linear().col(axis).cross(kinematic_tip_W_ - X_WF_.translation()));
    }
  }
  return D;
}

Eigen::VectorXd ArmKinematics::gravity_torque() const {
  Eigen::VectorXd torque(chain_->size());
  for (int j = 0; j < chain_->size(); ++j) {
    const auto k = static_cast<std::size_t>(j);
    torque(j) = chain_->joint(j).type == JointType::kRevolute ? z_[k].dot((p_cog_W_ - p_[k]).cross(force_W_))
                                                              : z_[k].dot(force_W_);
  }
  return torque;
}

Eigen::MatrixXd ArmKinematics::gravity_torque_jacobian() const {
  const StateRows rows(chain_->size());
  const int n = chain_->size();
  Eigen::MatrixXd T = Eigen::MatrixXd::Zero(n, rows.size());
  for (int j = 0; j < n; ++j) {
    const auto k = static_cast<std::size_t>(j);
    const bool revolute = chain_->joint(j).type == JointType::kRevolute;
    const Vector3 arm = p_cog_W_ - p_[k];
    // Upstream of the joint a rotation turns arm and axis alike: the same as turning the force back.
    const auto upstream = [&](const Vector3& w) {
      const Vector3 turned = -w.cross(force_W_);
      return revolute ? z_[k].dot(arm.cross(turned)) : z_[k].dot(turned);
    };
    const auto downstream = [&](const Vector3& cog_motion) {
      return revolute ? z_[k].dot(cog_motion.cross(force_W_)) : 0.0;
    };
    for (int row = 0; row < rows.base(0); ++row) {
      const Motion motion = link_motion(row);
      T(j, row) = row / 5 < j ? upstream(motion.w) : downstream(motion.v + motion.w.cross(p_cog_W_ - motion.origin));
    }
    for (int axis = 0; axis < 3; ++axis) T(j, rows.base(3 + axis)) = upstream(Vector3::Unit(axis));
    const Vector3 weight = kGravity * gravity_W_;
    T(j, rows.mass()) = revolute ? z_[k].dot(arm.cross(weight)) : z_[k].dot(weight);
    for (int axis = 0; axis < 3; ++axis) T(j, rows.cog(axis)) = downstream(X_WF_.linear().col(axis));
  }
  return T;
}

ArmKinematics::LoadedLink ArmKinematics::loaded_link(int joint) const {
  const auto k = static_cast<std::size_t>(joint);
  return {p_[k], q_[k], p_cog_W_, kinematic_tip_W_, force_W_};
}

Eigen::MatrixXd ArmKinematics::loaded_link_jacobian(int joint) const {
  const StateRows rows(chain_->size());
  const LoadedLink link = loaded_link(joint);
  Eigen::MatrixXd J = Eigen::MatrixXd::Zero(15, rows.size());
  for (int row = 0; row < rows.base(0); ++row) {
    const Motion motion = link_motion(row);
    const auto moved = [&](const Vector3& p) -> Vector3 { return motion.v + motion.w.cross(p - motion.origin); };
    // alpha and beta of a link turn about its far end, which stays.
    if (row / 5 < joint) J.block<3, 1>(0, row) = moved(link.start);
    if (row / 5 <= joint) J.block<3, 1>(3, row) = moved(link.end);
    J.block<3, 1>(6, row) = moved(link.cog);
    J.block<3, 1>(9, row) = moved(link.tip);
  }
  const Vector3 points[] = {link.start, link.end, link.cog, link.tip};
  for (int p = 0; p < 4; ++p) {
    J.block<3, 3>(3 * p, rows.base(0)).setIdentity();
    J.block<3, 3>(3 * p, rows.base(3)) = -skew(points[p] - X_WB_.translation());
  }
  const Matrix3 R_WF = X_WF_.linear();
  J.block<3, 3>(6, rows.cog(0)) = R_WF;
  J.block<3, 3>(9, rows.tool(0)) = R_WF;
  J.block<3, 3>(9, rows.tool(3)) = -skew(link.tip - X_WF_.translation()) * R_WF;
  J.block<3, 1>(12, rows.mass()) = kGravity * gravity_W_;
  return J;
}

}  // namespace trammel
