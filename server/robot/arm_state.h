#pragma once

#include <array>
#include <string>
#include <vector>

#include "server/robot/chain.h"
#include "server/robot/pose.h"

/// The state of the arm at one pose, and the derivative of the tool pose by each number of the
/// state.
namespace trammel {

struct Payload {
  double mass = 0;                      ///< kg
  Vector3 p_FoCog_F = Vector3::Zero();  ///< centre of gravity, m
};

constexpr double kGravity = 9.80665;  // m/s^2

/// kg m, one column per link: the first moment, about the joint's axis, of everything that the link
/// carries as one piece. Row 0 is along x of the link, row 1 along z x x, where z is the joint's
/// axis. No columns: only the payload and the stated masses of the links have weight.
using FirstMoments = Eigen::Matrix<double, 2, Eigen::Dynamic, 0, 2, kMaxJoints>;

/// The state that the error sources change, one after the other: nominal at first, the real arm at
/// the end.
struct ArmState {
  const Chain* chain = nullptr;     ///< not owned
  std::vector<LinkGeometry> links;  ///< n, joint values included
  Pose X_WB = Pose::Identity();
  Pose X_FT = Pose::Identity();
  Payload payload;
  Vector3 gravity_W = -Vector3::UnitZ();  ///< unit vector
  Vector6 tip_W = Vector6::Zero();  ///< small motion of T on top of the kinematics, [translation;
                                    ///< rotation vector] in W
  FirstMoments first_moments;       ///< beyond the stated masses; 2 x n or empty
  JointArray spring_torque;  ///< n or empty, Nm (N): the springs' addition to the gravity torque on
                             ///< each gear

  /// Adds `delta` (rad, m) to the joint as its gear would: through signs, and bars that couple it
  /// (Chain::drive).
  void add_to_joint(int joint, double delta);
};

/// The row of each number of an ArmState in a derivative: five rows per link, then base, tool,
/// payload, tip, first moments, springs. Base and tool rows are small motions [translation;
/// rotation vector]. The base motion is that of B in W, about the origin of B; the tool motion is
/// that of T in F, about the origin of F.
class StateRows {
 public:
  explicit StateRows(int joints) : joints_(joints) {}
  [[nodiscard]] int theta(int joint) const { return 5 * joint; }
  [[nodiscard]] int d(int joint) const { return 5 * joint + 1; }
  [[nodiscard]] int a(int joint) const { return 5 * joint + 2; }
  [[nodiscard]] int alpha(int joint) const { return 5 * joint + 3; }
  [[nodiscard]] int beta(int joint) const { return 5 * joint + 4; }
  /// The row of the value of joint `joint`: theta if revolute, d if prismatic.
  [[nodiscard]] int of_joint(const Chain& chain, int joint) const {
    return chain.joint(joint).type == JointType::kRevolute ? theta(joint) : d(joint);
  }
  [[nodiscard]] int base(int k) const { return 5 * joints_ + k; }
  [[nodiscard]] int tool(int k) const { return 5 * joints_ + 6 + k; }
  [[nodiscard]] int mass() const { return 5 * joints_ + 12; }
  [[nodiscard]] int cog(int k) const { return 5 * joints_ + 13 + k; }
  [[nodiscard]] int tip(int k) const { return 5 * joints_ + 16 + k; }
  [[nodiscard]] std::vector<int> whole_tip() const {
    return {tip(0), tip(1), tip(2), tip(3), tip(4), tip(5)};
  }
  [[nodiscard]] int first_moment(int link, int k) const { return 5 * joints_ + 22 + 2 * link + k; }
  [[nodiscard]] int spring(int joint) const { return 7 * joints_ + 22 + joint; }
  [[nodiscard]] int size() const { return 8 * joints_ + 22; }

 private:
  int joints_;
};

constexpr int kMaxStateRows = 8 * kMaxJoints + 22;

/// The derivative of `Rows` numbers by the state: one column for each of StateRows.
template <int Rows>
using StateMatrix = Eigen::Matrix<double, Rows, Eigen::Dynamic, 0, Rows, kMaxStateRows>;
/// A StateMatrix with a row for each joint.
using JointStateMatrix =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxJoints, kMaxStateRows>;

/// d(state)/d(parameters). Recorded while the sources act, and multiplied out once, from the last
/// source to the first. So the cost of a source does not grow with the number of parameters before
/// it.
class StateJacobian {
 public:
  StateJacobian(const Chain& chain, int parameters);
  /// Records that the parameter in `column` moves state row `row` by `rate` per unit.
  void add(int row, int column, double rate);
  /// add() for several rows from `first_row` and columns from `first_column`; zeros cost
  /// nothing.
  void add_block(int first_row, int first_column, const Eigen::Ref<const Eigen::MatrixXd>& rates);
  /// Records that the parameter in `column` moves `joint` (as ArmState::add_to_joint) by `rate` per
  /// unit.
  void add_to_joint(int joint, int column, double rate);
  /// Records that all changes of the state so far also change the numbers in `rows`. `by_state` is
  /// the derivative (one row for each of `rows`, one column for each of StateRows).
  void pass_on(std::vector<int> rows, Eigen::MatrixXd by_state);
  /// Records that every change of the state so far also moves `joint` (as ArmState::add_to_joint),
  /// by `by_state`.
  void pass_on_to_joint(int joint, const Eigen::RowVectorXd& by_state);
  /// Multiplies the numbers in the state rows from `first_row` on, and their derivatives so far, by
  /// `factor`.
  void transform(int first_row, const Eigen::Ref<const Eigen::MatrixXd>& factor);
  /// `by_state` (6 x StateRows::size()) times the recorded derivative: 6 x parameters.
  [[nodiscard]] Eigen::MatrixXd times(StateMatrix<6> by_state) const;

  StateRows rows;

 private:
  struct Entry {
    int row;
    int column;
    double rate;
  };
  struct Passage {
    std::size_t entries;  ///< number of entries recorded before
    std::vector<int> rows;
    int first_column;  ///< of by_state in the state
    Eigen::MatrixXd by_state;
  };
  const Chain* chain_;
  int parameters_;
  std::vector<Entry> entries_;
  std::vector<Passage> passages_;
};

/// Forward kinematics of a state, with derivatives.
class ArmKinematics {
 public:
  explicit ArmKinematics(const ArmState& state);

  [[nodiscard]] const Pose& tool_pose_W() const { return X_WT_; }
  /// [dp_WT; rotation vector] in W per unit of each state row.
  [[nodiscard]] StateMatrix<6> pose_jacobian() const;
  /// n: the torque on the gear of each joint, Nm, from all weights and springs (for a prismatic
  /// joint the force along it, N). It is the moment about the joint's axis, less the part that bars
  /// take over (Chain::bars). The weights are the payload and, if the robot file gives them, the
  /// links, each at its centre of gravity (the physical wrench). The links' first moments add their
  /// weights, which push no prismatic joint. Eq. (3.6) without C and the outer J.
  [[nodiscard]] JointArray gravity_torque() const;
  /// Derivative of gravity_torque().
  [[nodiscard]] JointStateMatrix gravity_torque_jacobian() const;
  /// Moment of all weights about the origin of B, Nm in W. First moments contribute all but their
  /// part along the first axis.
  [[nodiscard]] Vector3 base_moment() const;
  /// Derivative of base_moment().
  [[nodiscard]] StateMatrix<3> base_moment_jacobian() const;
  using JointJacobian = Eigen::Matrix<double, 6, Eigen::Dynamic, 0, 6, kMaxJoints>;
  /// 6 x n: the tool's motion in W per turn of each joint about its axis (signs and couplings do
  /// not enter).
  [[nodiscard]] JointJacobian axis_jacobian() const;
  /// 6 x n: the tool's motion in W per deflection of each joint's gear (signs do not enter, bars
  /// do), the J of eq. (3.6).
  [[nodiscard]] JointJacobian deflection_jacobian() const;
  /// Derivative of deflection_jacobian() * `of_gears`, with that deflection (n) held constant.
  [[nodiscard]] StateMatrix<6> deflection_jacobian_derivative(const JointArray& of_gears) const;
  /// Points in W on which bending depends: a point on the axis of `joint`, the far end of its link,
  /// the centre of gravity, the tool point. Also the weight, N.
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
  /// A weight on link `last`: it loads that link and all links before it.
  struct Body {
    Vector3 p, force;  ///< in W
    int last;
  };
  /// The first moment of a link in W, and per unit of its two numbers.
  struct FirstMoment {
    Vector3 moment, x, y;
  };
  using LinkVectors = Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, 5 * kMaxJoints>;
  /// One column per link row: the velocity in W of `point`, a point fixed to the parts beyond that
  /// link.
  [[nodiscard]] LinkVectors velocities_of(const Vector3& point) const;
  /// One column per link row: the rotation of everything downstream of the link.
  [[nodiscard]] LinkVectors turns() const;
  /// Adds to `T` the effect of the first moments on the derivative of the torques about the axes.
  void add_first_moments(const LinkVectors& turn, JointStateMatrix& T) const;

  const Chain* chain_;
  std::array<Link, kMaxJoints> links_;
  std::array<Body, kMaxJoints + 1> bodies_;  // the links', then the payload's
  int body_count_ = 0;
  std::array<FirstMoment, kMaxJoints> first_moments_;
  int first_moment_count_ = 0;  // n or 0
  JointArray spring_torque_;
  Pose X_WB_, X_WF_, X_WT_;
  Vector3 kinematic_tip_W_,
      tip_rotation_W_;  // the tool point before the tip's own motion, and that motion's rotation
  Vector3 p_cog_W_, force_W_, gravity_W_;
};

}  // namespace trammel
