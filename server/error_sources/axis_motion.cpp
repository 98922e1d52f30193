#include "server/error_sources/axis_motion.h"

#include <utility>
#include <vector>

namespace trammel {

namespace {

/// The frame in which an axis is at rest, in W, and the rotations that turn it.
struct Seat {
  struct Turn {
    int row;
    Vector3 about;
  };
  Matrix3 R;
  std::vector<Turn> turns;
};

Seat seat_of(const ArmState& state, int joint) {
  const StateRows rows(state.chain->size());
  const StateMatrix<6> J = ArmKinematics(state).pose_jacobian();
  const auto moves_along = [&](int row) -> Vector3 { return J.col(row).head<3>(); };
  Seat seat;
  seat.R = state.X_WB.linear();
  for (int axis = 0; axis < 3; ++axis)
    seat.turns.push_back({rows.base(3 + axis), Vector3::Unit(axis)});
  for (int i = 0; i < joint; ++i) {
    const Vector3 x = moves_along(rows.a(i));
    const Vector3 z = moves_along(rows.d(i + 1));
    const Vector3 y = z.cross(x).normalized();
    seat.turns.push_back({rows.theta(i), moves_along(rows.d(i))});
    seat.turns.push_back({rows.alpha(i), x});
    seat.turns.push_back({rows.beta(i), y});
    seat.R << y.cross(z), y, z;
  }
  return seat;
}

/// Shifts an axis. Everything beyond it, the tool included, moves by the same vector.
void shift_axis(int joint, const AxisMotion& rates, const Vector3& along, ArmState& state,
                StateJacobian* jacobian, int first_column) {
  const Seat seat = seat_of(state, joint);
  const Vector3 moved = seat.R * along;
  state.tip_W.head<3>() += moved;
  if (jacobian == nullptr) return;
  const StateRows& rows = jacobian->rows;
  Eigen::MatrixXd by_state = Eigen::MatrixXd::Zero(3, rows.size());
  for (const Seat::Turn& turn : seat.turns) by_state.col(turn.row) = turn.about.cross(moved);
  jacobian->pass_on({rows.tip(0), rows.tip(1), rows.tip(2)}, std::move(by_state));
  jacobian->add_block(rows.tip(0), first_column, seat.R * rates.topRows<3>());
}

void tilt_base(const AxisMotion& rates, const Eigen::Vector2d& about, ArmState& state,
               StateJacobian* jacobian, int first_column) {
  const Matrix3 about_x = Eigen::AngleAxisd(about(0), Vector3::UnitX()).toRotationMatrix();
  const Matrix3 about_y = Eigen::AngleAxisd(about(1), Vector3::UnitY()).toRotationMatrix();
  Eigen::Matrix<double, 3, 2> axes;
  axes << state.X_WB.linear().col(0), state.X_WB.linear() * about_x.col(1);
  state.X_WB.linear() = (state.X_WB.linear() * about_x * about_y).eval();
  if (jacobian != nullptr)
    jacobian->add_block(jacobian->rows.base(3), first_column, axes * rates.bottomRows<2>());
}

/// By twist and tilt of the link before.
void tilt_axis(int joint, const AxisMotion& rates, const Eigen::Vector2d& about, ArmState& state,
               StateJacobian* jacobian, int first_column) {
  LinkGeometry& before = state.links[static_cast<std::size_t>(joint - 1)];
  before.alpha += about(0);
  before.beta += about(1);
  if (jacobian == nullptr) return;
  jacobian->add_block(jacobian->rows.alpha(joint - 1), first_column, rates.row(3));
  jacobian->add_block(jacobian->rows.beta(joint - 1), first_column, rates.row(4));
}

}  // namespace

void move_axis(int joint, const AxisMotion& rates, const Eigen::Ref<const Eigen::VectorXd>& values,
               ArmState& state, StateJacobian* jacobian, int first_column) {
  const Eigen::Matrix<double, 5, 1> motion = rates * values;
  shift_axis(joint, rates, motion.head<3>(), state, jacobian, first_column);
  if (joint > 0) {
    tilt_axis(joint, rates, motion.tail<2>(), state, jacobian, first_column);
  } else {
    tilt_base(rates, motion.tail<2>(), state, jacobian, first_column);
  }
}

}  // namespace trammel
