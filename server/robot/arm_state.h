#pragma once

#include <array>
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
  /// The row that joint `joint` of `chain` itself turns or shifts.
  [[nodiscard]] int of_joint(const Chain& chain, int joint) const {
    return chain.joint(joint).type == JointType::kRevolute ? theta(joint) : d(joint);
  }
  [[nodiscard]] int base(int k) const { return 5 * joints_ + k; }
  [[nodiscard]] int tool(int k) const { return 5 * joints_ + 6 + k; }
  [[nodiscard]] int mass() const { return 5 * joints_ + 12; }
  [[nodiscard]] int cog(int k) const { return 5 * joints_ + 13 + k; }
  [[nodiscard]] int tip(int k) const { return 5 * joints_ + 16 + k; }
  [[nodiscard]] std::vector<int> whole_tip() const { return {tip(0), tip(1), tip(2), tip(3), tip(4), tip(5)}; }
  [[nodiscard]] int size() const { return 5 * joints_ + 22; }

 private:
  int joints_;
};

constexpr int kMaxStateRows = 5 * kMaxJoints + 22;

/// Something of `Rows` numbers by every number of the state: one column for each of StateRows.
template <int Rows>
using StateMatrix = Eigen::Matrix<double, Rows, Eigen::Dynamic, 0, Rows, kMaxStateRows>;
/// The same with a row for each joint.
using JointStateMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxJoints, kMaxStateRows>;

/// d(state)/d(parameters), recorded while sources act and multiplied out once from its end, so that a source costs the
/// same however many parameters came before it.
class StateJacobian {
 public:
  StateJacobian(const Chain& chain, int parameters);
  /// The parameter in `column` moves the number in state row `row` by `rate` per unit.
  void add(int row, int column, double rate);
  /// The same for several rows from `first_row` and columns from `first_column`; zeros cost nothing.
  void add_block(int first_row, int first_column, const Eigen::Ref<const Eigen::MatrixXd>& rates);
  /// The parameter in `column` moves `joint` (as ArmState::add_to_joint) by `rate` per unit.
  void add_to_joint(int joint, int column, double rate);
  /// Whatever has moved the state so far moves the numbers in `rows` in addition, by `by_state` (one row for each of
  /// them, a column for each of StateRows).
  void pass_on(std::vector<int> rows, Eigen::MatrixXd by_state);
  /// Whatever has moved the state so far moves `joint` (as ArmState::add_to_joint) in addition, by `by_state`.
  void pass_on_to_joint(int joint, const Eigen::RowVectorXd& by_state);
  /// The numbers in the state rows from `first_row` on become `factor` times what they were, with all that moved them.
  void transform(int first_row, const Eigen::Ref<const Eigen::MatrixXd>& factor);
  /// `by_state` (6 x StateRows::size()) times all that was recorded: 6 x parameters.
  [[nodiscard]] Eigen::MatrixXd times(StateMatrix<6> by_state) const;

  StateRows rows;

 private:
  struct Entry {
    int row;
    int column;
    double rate;
  };
  struct Passage {
    std::size_t entries;  ///< how many were recorded before
    std::vector<int> rows;
    int first_column;  ///< of by_state in the state
    Eigen::MatrixXd by_state;
  };
  const Chain* chain_;
  int parameters_;
  std::vector<Entry> entries_;
  std::vector<Passage> passages_;
};

/// Forward kinematics of a state with everything needed to differentiate it.
class ArmKinematics {
 public:
  explicit ArmKinematics(const ArmState& state);

  [[nodiscard]] const Pose& tool_pose_W() const { return X_WT_; }
  /// [dp_WT; rotation vector] in W per unit of each state row.
  [[nodiscard]] StateMatrix<6> pose_jacobian() const;
  /// n: moment of all weights about each joint's axis (force along a prismatic one), Nm (N): the payload's and, where
  /// the robot file gives them, the links', each at its centre of gravity (the physical wrench), eq. (3.6) without C
  /// and the outer J.
  [[nodiscard]] JointArray gravity_torque() const;
  /// Derivative of gravity_torque().
  [[nodiscard]] JointStateMatrix gravity_torque_jacobian() const;
  /// 6 x n: the tool's motion in W per joint deflection (signs and couplings do not enter), the J of eq. (3.6).
  using DeflectionJacobian = Eigen::Matrix<double, 6, Eigen::Dynamic, 0, 6, kMaxJoints>;
  [[nodiscard]] DeflectionJacobian deflection_jacobian() const;
  /// Derivative of deflection_jacobian() * `deflection` with the deflection (n) held.
  [[nodiscard]] StateMatrix<6> deflection_jacobian_derivative(const JointArray& deflection) const;
  /// Points in W that bending depends on: axis of `joint`, far end of its link, centre of gravity, tool point; and the
  /// weight, N.
  struct LoadedLink {
    Vector3 start, end, cog, tip, weight;
  };
  [[nodiscard]] LoadedLink loaded_link(int joint) const;
  /// Derivative of the five vectors of loaded_link(joint), one under the other.
  [[nodiscard]] StateMatrix<15> loaded_link_jacobian(int joint) const;

 private:
  /// In W: joint axis and a point on it; x and y axis at the link's end q.
  struct Link {
    Vector3 z, p, x, y, q;
  };
  /// Something heavy, carried by link `last` and all before it.
  struct Body {
    Vector3 p, force;  ///< in W
    int last;
  };
  using LinkVectors = Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, 5 * kMaxJoints>;
  /// One column a link row: how fast `point` moves in W, carried by everything downstream of the link.
  [[nodiscard]] LinkVectors velocities_of(const Vector3& point) const;
  /// One column a link row: the rotation of everything downstream.
  [[nodiscard]] LinkVectors turns() const;

  const Chain* chain_;
  std::array<Link, kMaxJoints> links_;
  std::array<Body, kMaxJoints + 1> bodies_;  // the links', then the payload's
  int body_count_ = 0;
  Pose X_WB_, X_WF_, X_WT_;
  Vector3 kinematic_tip_W_, tip_rotation_W_;  // the tool point before the tip's own motion, and that motion's rotation
  Vector3 p_cog_W_, force_W_, gravity_W_;
};

}  // namespace trammel
