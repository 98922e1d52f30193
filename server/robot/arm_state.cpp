#include "server/robot/arm_state.h"

#include <cmath>
#include <numeric>
#include <utility>

#include "server/base/check.h"

namespace trammel {

void ArmState::add_to_joint(int joint, double delta) {
  for (int i = 0; i < chain->size(); ++i) {
    LinkGeometry& link = links[static_cast<std::size_t>(i)];
    (chain->joint(i).type == JointType::kRevolute ? link.theta : link.d) +=
        chain->drive()(i, joint) * delta;
  }
}

StateJacobian::StateJacobian(const Chain& chain, int parameters)
    : rows(chain.size()), chain_(&chain), parameters_(parameters) {
  constexpr std::size_t kRowsOfMost = 3;  // rows reserved per parameter; most parameters move fewer
  entries_.reserve(kRowsOfMost * static_cast<std::size_t>(parameters));
}

void StateJacobian::add(int row, int column, double rate) {
  entries_.push_back({row, column, rate});
}

void StateJacobian::add_block(int first_row, int first_column,
                              const Eigen::Ref<const Eigen::MatrixXd>& rates) {
  for (int column = 0; column < rates.cols(); ++column) {
    for (int row = 0; row < rates.rows(); ++row) {
      if (rates(row, column) != 0) add(first_row + row, first_column + column, rates(row, column));
    }
  }
}

void StateJacobian::add_to_joint(int joint, int column, double rate) {
  for (int i = 0; i < chain_->size(); ++i) {
    const double share = chain_->drive()(i, joint);
    if (share != 0) add(rows.of_joint(*chain_, i), column, share * rate);
  }
}

void StateJacobian::pass_on(std::vector<int> into, Eigen::MatrixXd by_state) {
  TRAMMEL_CHECK(by_state.rows() == static_cast<Eigen::Index>(into.size()) &&
                by_state.cols() == rows.size());
  passages_.push_back({entries_.size(), std::move(into), 0, std::move(by_state)});
}

void StateJacobian::pass_on_to_joint(int joint, const Eigen::RowVectorXd& by_state) {
  std::vector<int> into;
  for (int i = 0; i < chain_->size(); ++i) into.push_back(rows.of_joint(*chain_, i));
  pass_on(std::move(into), chain_->drive().col(joint) * by_state);
}

void StateJacobian::transform(int first_row, const Eigen::Ref<const Eigen::MatrixXd>& factor) {
  std::vector<int> into(static_cast<std::size_t>(factor.rows()));
  std::iota(into.begin(), into.end(), first_row);
  passages_.push_back({entries_.size(), std::move(into), first_row,
                       factor - Eigen::MatrixXd::Identity(factor.rows(), factor.cols())});
}

Eigen::MatrixXd StateJacobian::times(StateMatrix<6> by_state) const {
  // A passage multiplies d(state) by (I + E L): L is the passage's own by_state, E puts its rows
  // into the state. So, going backwards, `by_state` becomes by_state (I + E L) for the entries
  // recorded before the passage.
  Eigen::MatrixXd product = Eigen::MatrixXd::Zero(6, parameters_);
  std::size_t end = entries_.size();
  const auto collect = [&](std::size_t begin) {
    for (std::size_t i = begin; i < end; ++i) {
      product.col(entries_[i].column).head<6>() += entries_[i].rate * by_state.col(entries_[i].row);
    }
    end = begin;
  };
  for (auto passage = passages_.rbegin(); passage != passages_.rend(); ++passage) {
    collect(passage->entries);
    const Eigen::Matrix<double, 6, Eigen::Dynamic, 0, 6, kMaxJoints> through =
        by_state(Eigen::all, passage->rows);
    for (Eigen::Index column = 0; column < passage->by_state.cols(); ++column) {
      Vector6 sum = by_state.col(passage->first_column + column);
      for (Eigen::Index k = 0; k < through.cols(); ++k)
        sum += passage->by_state(k, column) * through.col(k);
      by_state.col(passage->first_column + column) = sum;
    }
  }
  collect(0);
  return product;
}

ArmKinematics::ArmKinematics(const ArmState& state)
    : chain_(state.chain),
      spring_torque_(state.spring_torque),
      X_WB_(state.X_WB),
      gravity_W_(state.gravity_W) {
  TRAMMEL_CHECK(chain_ != nullptr &&
                state.links.size() == static_cast<std::size_t>(chain_->size()));
  Vector3 x = state.X_WB.linear().col(0);
  Vector3 y = state.X_WB.linear().col(1);
  Vector3 z = state.X_WB.linear().col(2);
  Vector3 p = state.X_WB.translation();
  const auto turn = [](Vector3& from, Vector3& to, double angle) {  // about the third axis
    const double c = std::cos(angle);
    const double s = std::sin(angle);
    const Vector3 turned = c * from + s * to;
    to = c * to - s * from;
    from = turned;
  };
  first_moment_count_ = static_cast<int>(state.first_moments.cols());
  TRAMMEL_CHECK(first_moment_count_ == 0 || first_moment_count_ == chain_->size());
  for (std::size_t i = 0; i < state.links.size(); ++i) {
    const LinkGeometry& geometry = state.links[i];
    Link& link = links_[i];
    link.z = z;
    link.p = p;
    turn(x, y, geometry.theta);
    if (first_moment_count_ > 0) {
      const auto moment = state.first_moments.col(static_cast<Eigen::Index>(i));
      first_moments_[i] = {x * moment.x() + y * moment.y(), x, y};
    }
    p += z * geometry.d + x * geometry.a;
    turn(y, z, geometry.alpha);
    link.x = x;
    link.y = y;
    link.q = p;
    if (geometry.beta != 0) turn(z, x, geometry.beta);
    const Joint& joint = chain_->joint(static_cast<int>(i));
    if (joint.mass > 0) {
      const Vector3 cog = p + x * joint.p_cog.x() + y * joint.p_cog.y() + z * joint.p_cog.z();
      bodies_[static_cast<std::size_t>(body_count_++)] = {cog, joint.mass * kGravity * gravity_W_,
                                                          static_cast<int>(i)};
    }
  }
  X_WF_ = Pose::Identity();
  X_WF_.linear() << x, y, z;
  X_WF_.translation() = p;
  X_WT_ = X_WF_ * state.X_FT;
  kinematic_tip_W_ = X_WT_.translation();
  tip_rotation_W_ = state.tip_W.tail<3>();
  X_WT_.translation() += state.tip_W.head<3>();
  if (!tip_rotation_W_.isZero(0)) {
    X_WT_.linear() = (rotation_exp(tip_rotation_W_) * X_WT_.linear()).eval();
  }
  p_cog_W_ = X_WF_ * state.payload.p_FoCog_F;
  force_W_ = state.payload.mass * kGravity * gravity_W_;
  bodies_[static_cast<std::size_t>(body_count_++)] = {p_cog_W_, force_W_, chain_->size() - 1};
}

ArmKinematics::LinkVectors ArmKinematics::velocities_of(const Vector3& point) const {
  LinkVectors velocities(3, 5 * chain_->size());
  for (int i = 0; i < chain_->size(); ++i) {
    const Link& link = links_[static_cast<std::size_t>(i)];
    velocities.col(5 * i) = link.z.cross(point - link.p);
    velocities.col(5 * i + 1) = link.z;
    velocities.col(5 * i + 2) = link.x;
    velocities.col(5 * i + 3) = link.x.cross(point - link.q);
    velocities.col(5 * i + 4) = link.y.cross(point - link.q);
  }
  return velocities;
}

ArmKinematics::LinkVectors ArmKinematics::turns() const {
  LinkVectors turns(3, 5 * chain_->size());
  for (int i = 0; i < chain_->size(); ++i) {
    const Link& link = links_[static_cast<std::size_t>(i)];
    turns.col(5 * i) = link.z;
    turns.col(5 * i + 1).setZero();
    turns.col(5 * i + 2).setZero();
    turns.col(5 * i + 3) = link.x;
    turns.col(5 * i + 4) = link.y;
  }
  return turns;
}

StateMatrix<6> ArmKinematics::pose_jacobian() const {
  const StateRows rows(chain_->size());
  StateMatrix<6> J = StateMatrix<6>::Zero(6, rows.size());
  const Vector3& p = kinematic_tip_W_;
  J.topLeftCorner(3, rows.base(0)) = velocities_of(p);
  J.bottomLeftCorner(3, rows.base(0)) = turns();
  J.block<3, 3>(0, rows.base(0)).setIdentity();
  J.block<3, 3>(0, rows.base(3)) = -skew(p - X_WB_.translation());
  J.block<3, 3>(3, rows.base(3)).setIdentity();
  const Matrix3 R_WF = X_WF_.linear();
  J.block<3, 3>(0, rows.tool(0)) = R_WF;
  J.block<3, 3>(0, rows.tool(3)) = -skew(p - X_WF_.translation()) * R_WF;
  J.block<3, 3>(3, rows.tool(3)) = R_WF;
  if (!tip_rotation_W_.isZero(0)) {  // R_WT = exp(tip) R_kinematic
    const Matrix3 R_tip = rotation_exp(tip_rotation_W_);
    for (int row = 0; row < rows.tip(0); ++row)
      J.col(row).tail<3>() = (R_tip * J.col(row).tail<3>()).eval();
  }
  J.block<3, 3>(0, rows.tip(0)).setIdentity();
  J.block<3, 3>(3, rows.tip(3)) = left_jacobian(tip_rotation_W_);
  return J;
}

ArmKinematics::JointJacobian ArmKinematics::deflection_jacobian() const {
  if (!chain_->has_bars()) return axis_jacobian();
  return axis_jacobian() * chain_->bars();
}

ArmKinematics::JointJacobian ArmKinematics::axis_jacobian() const {
  JointJacobian J = JointJacobian::Zero(6, chain_->size());
  for (int j = 0; j < chain_->size(); ++j) {
    const Link& link = links_[static_cast<std::size_t>(j)];
    if (chain_->joint(j).type == JointType::kRevolute) {
      J.col(j).head<3>() = link.z.cross(kinematic_tip_W_ - link.p);
      J.col(j).tail<3>() = link.z;
    } else {
      J.col(j).head<3>() = link.z;
    }
  }
  return J;
}

StateMatrix<6> ArmKinematics::deflection_jacobian_derivative(const JointArray& of_gears) const {
  const StateRows rows(chain_->size());
  const JointArray deflection =
      chain_->has_bars() ? JointArray(chain_->bars() * of_gears) : of_gears;
  const JointJacobian J = axis_jacobian();
  const LinkVectors velocity = velocities_of(kinematic_tip_W_);
  const LinkVectors turn = turns();
  StateMatrix<6> D = StateMatrix<6>::Zero(6, rows.size());
  // When a link turns, the Jacobian columns of joints beyond it turn too. In the columns of the
  // joints up to it only the lever changes.
  Vector6 beyond = J * deflection;
  Vector3 up_to = Vector3::Zero();
  const auto turned = [&](int row, const Vector3& w) {
    D.col(row).head<3>() += w.cross(beyond.head<3>());
    D.col(row).tail<3>() += w.cross(beyond.tail<3>());
  };
  const auto shifted = [&](int row, const Vector3& tip_motion) {
    D.col(row).head<3>() += up_to.cross(tip_motion);
  };
  for (int axis = 0; axis < 3; ++axis) turned(rows.base(3 + axis), Vector3::Unit(axis));
  for (int i = 0; i < chain_->size(); ++i) {
    beyond -= deflection(i) * J.col(i);
    up_to += deflection(i) * J.col(i).tail<3>();
    for (int row = rows.theta(i); row <= rows.beta(i); ++row) {
      turned(row, turn.col(row));
      shifted(row, velocity.col(row));
    }
  }
  for (int axis = 0; axis < 3; ++axis) {
    shifted(rows.tool(axis), X_WF_.linear().col(axis));
    shifted(rows.tool(3 + axis),
            X_WF_.linear().col(axis).cross(kinematic_tip_W_ - X_WF_.translation()));
  }
  return D;
}

JointArray ArmKinematics::gravity_torque() const {
  JointArray torque = JointArray::Zero(chain_->size());
  for (int k = 0; k < body_count_; ++k) {
    const Body& body = bodies_[static_cast<std::size_t>(k)];
    for (int j = 0; j <= body.last; ++j) {
      const Link& link = links_[static_cast<std::size_t>(j)];
      torque(j) += chain_->joint(j).type == JointType::kRevolute
                       ? link.z.dot((body.p - link.p).cross(body.force))
                       : link.z.dot(body.force);
    }
  }
  const Vector3 gravity = kGravity * gravity_W_;
  for (int i = 0; i < first_moment_count_; ++i) {
    const Vector3 turning = first_moments_[static_cast<std::size_t>(i)].moment.cross(gravity);
    for (int j = 0; j <= i; ++j) {
      if (chain_->joint(j).type == JointType::kRevolute)
        torque(j) += links_[static_cast<std::size_t>(j)].z.dot(turning);
    }
  }
  if (chain_->has_bars()) torque = (chain_->bars().transpose() * torque).eval();
  if (spring_torque_.size() > 0) torque += spring_torque_;
  return torque;
}

JointStateMatrix ArmKinematics::gravity_torque_jacobian() const {
  const StateRows rows(chain_->size());
  const int n = chain_->size();
  const LinkVectors turn = turns();
  JointStateMatrix T = JointStateMatrix::Zero(n, rows.size());
  for (int k = 0; k < body_count_; ++k) {
    const Body& body = bodies_[static_cast<std::size_t>(k)];
    const LinkVectors velocity = velocities_of(body.p);
    for (int j = 0; j <= body.last; ++j) {
      const Vector3& z = links_[static_cast<std::size_t>(j)].z;
      const bool revolute = chain_->joint(j).type == JointType::kRevolute;
      // The direction in which a force does work on the joint: tau = leverage . F.
      const Vector3 leverage =
          revolute ? z.cross(body.p - links_[static_cast<std::size_t>(j)].p) : z;
      // A rotation upstream of the joint turns lever and axis together. That equals turning the
      // force back.
      const Vector3 by_turn = leverage.cross(body.force);
      const Vector3 by_cog = revolute ? body.force.cross(z) : Vector3::Zero();
      for (int row = 0; row < rows.theta(j); ++row) T(j, row) += by_turn.dot(turn.col(row));
      for (int row = rows.theta(j); row < 5 * (body.last + 1); ++row)
        T(j, row) += by_cog.dot(velocity.col(row));
      T.block<1, 3>(j, rows.base(3)) += by_turn.transpose();
      if (k + 1 < body_count_) continue;
      T(j, rows.mass()) += kGravity * leverage.dot(gravity_W_);
      T.block<1, 3>(j, rows.cog(0)) += by_cog.transpose() * X_WF_.linear();
    }
  }
  add_first_moments(turn, T);
  if (chain_->has_bars()) T = (chain_->bars().transpose() * T).eval();
  for (int j = 0; j < spring_torque_.size(); ++j) T(j, rows.spring(j)) = 1;
  return T;
}

void ArmKinematics::add_first_moments(const LinkVectors& turn, JointStateMatrix& T) const {
  const StateRows rows(chain_->size());
  const Vector3 gravity = kGravity * gravity_W_;
  for (int i = 0; i < first_moment_count_; ++i) {
    const FirstMoment& first = first_moments_[static_cast<std::size_t>(i)];
    for (int j = 0; j <= i; ++j) {
      if (chain_->joint(j).type != JointType::kRevolute) continue;
      const Vector3& z = links_[static_cast<std::size_t>(j)].z;
      // As for a body: a rotation before the joint turns axis and moment together, a rotation
      // beyond it turns the moment alone.
      const Vector3 by_turn = z.cross(first.moment).cross(gravity);
      const Vector3 by_moment = gravity.cross(z);
      for (int row = 0; row < rows.theta(j); ++row) T(j, row) += by_turn.dot(turn.col(row));
      const Vector3 by_turn_beyond = first.moment.cross(by_moment);
      for (int row = rows.theta(j); row <= rows.theta(i); ++row)
        T(j, row) += by_turn_beyond.dot(turn.col(row));
      T.block<1, 3>(j, rows.base(3)) += by_turn.transpose();
      T(j, rows.first_moment(i, 0)) += by_moment.dot(first.x);
      T(j, rows.first_moment(i, 1)) += by_moment.dot(first.y);
    }
  }
}

Vector3 ArmKinematics::base_moment() const {
  Vector3 moment = Vector3::Zero();
  for (int k = 0; k < body_count_; ++k) {
    const Body& body = bodies_[static_cast<std::size_t>(k)];
    moment += (body.p - X_WB_.translation()).cross(body.force);
  }
  for (int i = 0; i < first_moment_count_; ++i)
    moment += first_moments_[static_cast<std::size_t>(i)].moment.cross(kGravity * gravity_W_);
  return moment;
}

StateMatrix<3> ArmKinematics::base_moment_jacobian() const {
  const StateRows rows(chain_->size());
  const Vector3 gravity = kGravity * gravity_W_;
  StateMatrix<3> D = StateMatrix<3>::Zero(3, rows.size());
  for (int k = 0; k < body_count_; ++k) {
    const Body& body = bodies_[static_cast<std::size_t>(k)];
    const int moving = 5 * (body.last + 1);
    D.leftCols(moving) -= skew(body.force) * velocities_of(body.p).leftCols(moving);
    D.block<3, 3>(0, rows.base(3)) += skew(body.force) * skew(body.p - X_WB_.translation());
  }
  const Vector3 lever = p_cog_W_ - X_WB_.translation();
  D.col(rows.mass()) = kGravity * lever.cross(gravity_W_);
  D.block<3, 3>(0, rows.cog(0)) = -skew(force_W_) * X_WF_.linear();
  const LinkVectors turn = turns();
  for (int i = 0; i < first_moment_count_; ++i) {
    const FirstMoment& first = first_moments_[static_cast<std::size_t>(i)];
    const Matrix3 by_turn = skew(gravity) * skew(first.moment);
    D.leftCols(rows.theta(i) + 1) += by_turn * turn.leftCols(rows.theta(i) + 1);
    D.block<3, 3>(0, rows.base(3)) += by_turn;
    D.col(rows.first_moment(i, 0)) = first.x.cross(gravity);
    D.col(rows.first_moment(i, 1)) = first.y.cross(gravity);
  }
  return D;
}

ArmKinematics::LoadedLink ArmKinematics::loaded_link(int joint) const {
  const Link& link = links_[static_cast<std::size_t>(joint)];
  return {link.p, link.q, p_cog_W_, kinematic_tip_W_, force_W_};
}

StateMatrix<15> ArmKinematics::loaded_link_jacobian(int joint) const {
  const StateRows rows(chain_->size());
  const LoadedLink link = loaded_link(joint);
  StateMatrix<15> J = StateMatrix<15>::Zero(15, rows.size());
  const Vector3 points[] = {link.start, link.end, link.cog, link.tip};
  // The rows that move each point are those of the links before it. alpha and beta of a link turn
  // about its far end, which stays.
  const int moving[] = {rows.theta(joint), rows.theta(joint) + 5, rows.base(0), rows.base(0)};
  for (int p = 0; p < 4; ++p) {
    J.block(3 * p, 0, 3, moving[p]) = velocities_of(points[p]).leftCols(moving[p]);
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
