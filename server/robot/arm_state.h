#pragma once

#include <string>
#include <vector>

#include "server/robot/chain.h"
#include "server/robot/pose.h"

/// The arm as it stands at one pose, and how its tool moves when any of its numbers changes.
namespace trammel {

struct Payload {
  double mass = 0;                      ///< kg
  Vector3 p_FoCog_F = Vector3::Zero();  ///< centre of gravity, m
};

constexpr double kGravity = 9.80665;  // m/s^2

/// What error sources act upon, one after the other: it starts nominal and ends as the real arm stands.
struct ArmState {
  const Chain* chain = nullptr;     ///< not owned
  std::vector<LinkGeometry> links;  ///< n, joint values included
  Pose X_WB = Pose::Identity();
  Pose X_FT = Pose::Identity();
  Payload payload;
  Vector3 gravity_W = -Vector3::UnitZ();  ///< unit vector
  Vector6 tip_W = Vector6::Zero();  ///< small motion of T on top of the kinematics, [translation; rotation vector] in W

  /// Adds `delta` (rad, m) to the joint as its encoder would: through signs and couplings.
  void add_to_joint(int joint, double delta);
};

/// Where each number of an ArmState stands in a derivative: five rows a link, then base, tool, payload, tip.
/// Base and tool rows are small motions [translation; rotation vector]: of B seen in W, about the origin of B; of T
/// seen in F, about the origin of F.
class StateRows {
 public:
  explicit StateRows(int joints) : joints_(joints) {}
  [[nodiscard]] int theta(int joint) const { return 5 * joint; }
  [[nodiscard]] int d(int joint) const { return 5 * joint + 1; }
  [[nodiscard]] int a(int joint) const { return 5 * joint + 2; }
  [[nodiscard]] int alpha(int joint) const { return 5 * joint + 3; }
  [[nodiscard]] int beta(int joint) const { return 5 * joint + 4; }
  [[nodiscard]] int base(int k) const { return 5 * joints_ + k; }
  [[nodiscard]] int tool(int k) const { return 5 * joints_ + 6 + k; }
  [[nodiscard]] int mass() const { return 5 * joints_ + 12; }
  [[nodiscard]] int cog(int k) const { return 5 * joints_ + 13 + k; }
  [[nodiscard]] int tip(int k) const { return 5 * joints_ + 16 + k; }
  [[nodiscard]] int size() const { return 5 * joints_ + 22; }

 private:
  int joints_;
};

/// d(state)/d(parameters): rows as StateRows, one column a parameter.
class StateJacobian {
 public:
  StateJacobian(const Chain& chain, int parameters)
      : rows(chain.size()), matrix(Eigen::MatrixXd::Zero(rows.size(), parameters)), chain_(&chain) {}
  /// The parameter in `column` moves `joint` (as ArmState::add_to_joint) by `rate` per unit.
  void add_to_joint(int joint, int column, double rate);

  StateRows rows;
  Eigen::MatrixXd matrix;

 private:
  const Chain* chain_;
};

/// Forward kinematics of a state with everything needed to differentiate it.
class ArmKinematics {
 public:
  explicit ArmKinematics(const ArmState& state);

  [[nodiscard]] const Pose& tool_pose_W() const { return X_WT_; }
  /// 6 x StateRows::size(): [dp_WT; rotation vector] in W per unit of each state row.
  [[nodiscard]] Eigen::MatrixXd pose_jacobian() const;
  /// n: moment of the payload's weight about each joint's axis (force along a prismatic one), Nm (N), physical wrench:
  /// gravity at the centre of gravity, eq. (3.6) without C and the outer J.
  [[nodiscard]] Eigen::VectorXd gravity_torque() const;
  /// n x StateRows::size(): derivative of gravity_torque().
  [[nodiscard]] Eigen::MatrixXd gravity_torque_jacobian() const;
  /// 6 x n: the tool's motion in W per joint deflection (signs and couplings do not enter), the J of eq. (3.6).
  [[nodiscard]] Eigen::MatrixXd deflection_jacobian() const;
  /// 6 x StateRows::size(): derivative of deflection_jacobian() * `deflection` with the deflection (n) held.
  [[nodiscard]] Eigen::MatrixXd deflection_jacobian_derivative(const Eigen::VectorXd& deflection) const;
  /// Points in W that bending depends on: axis of `joint`, far end of its link, centre of gravity, tool point; and the
  /// weight, N.
  struct LoadedLink {
    Vector3 start, end, cog, tip, weight;
  };
  [[nodiscard]] LoadedLink loaded_link(int joint) const;
  /// 15 x StateRows::size(): derivative of the five vectors of loaded_link(joint), one under the other.
  [[nodiscard]] Eigen::MatrixXd loaded_link_jacobian(int joint) const;

 private:
  struct Motion {  // what is downstream moves by [v + w x (p - origin); w]
    Vector3 v = Vector3::Zero();
    Vector3 w = Vector3::Zero();
    Vector3 origin = Vector3::Zero();
  };
  [[nodiscard]] Motion link_motion(int row) const;

  const Chain* chain_;
  std::vector<Vector3> z_, p_, x_, y_,
      q_;  // per link, in W: joint axis and a point on it; x and y axis at the link's end q
  Pose X_WB_, X_WF_, X_WT_;
  Vector3 kinematic_tip_W_, tip_rotation_W_;  // the tool point before the tip's own motion, and that motion's rotation
  Vector3 p_cog_W_, force_W_, gravity_W_;
};

}  // namespace trammel
