#include "server/error_sources/frame_motion.h"

namespace trammel {

Pose motion_of(const Eigen::Ref<const Eigen::VectorXd>& values) {
  return pose_zyx(values.head<3>(), values(3), values(4), values(5));
}

Matrix3 rotation_axes(const Eigen::Ref<const Eigen::VectorXd>& values) {
  const Matrix3 Rz = Eigen::AngleAxisd(values(3), Vector3::UnitZ()).toRotationMatrix();
  const Matrix3 RzRy = Rz * Eigen::AngleAxisd(values(4), Vector3::UnitY()).toRotationMatrix();
  Matrix3 axes;
  axes << Vector3::UnitZ(), Rz.col(1), RzRy.col(0);
  return axes;
}

void move_tool(const Eigen::Ref<const Eigen::VectorXd>& values, ArmState& state,
               StateJacobian* jacobian, int first_column) {
  const Pose motion = motion_of(values);
  state.X_FT = motion * state.X_FT;
  if (jacobian == nullptr) return;
  const Vector3 t = motion.translation();
  const int translation = jacobian->rows.tool(0);
  const int rotation = jacobian->rows.tool(3);
  // A motion [v; w] of T in F becomes [R v + t x R w; R w].
  Eigen::Matrix<double, 6, 6> earlier;
  earlier << motion.linear(), skew(t) * motion.linear(), Matrix3::Zero(), motion.linear();
  jacobian->transform(translation, earlier);
  const Matrix3 axes = rotation_axes(values);
  jacobian->add_block(translation, first_column, Matrix3::Identity());
  jacobian->add_block(rotation, first_column + 3, axes);
  // These axes go through t, the rows through the origin of F.
  jacobian->add_block(translation, first_column + 3, skew(t) * axes);
}

void move_base_in_world(const Eigen::Ref<const Eigen::VectorXd>& values, double rate,
                        ArmState& state, StateJacobian* jacobian, int first_column) {
  const Eigen::VectorXd moved = rate * values;
  const Pose motion = motion_of(moved);
  state.X_WB.translation() += motion.translation();
  state.X_WB.linear() = (motion.linear() * state.X_WB.linear()).eval();
  if (jacobian == nullptr) return;
  const int translation = jacobian->rows.base(0);
  const int rotation = jacobian->rows.base(3);
  jacobian->transform(rotation, motion.linear());
  jacobian->add_block(translation, first_column, rate * Matrix3::Identity());
  jacobian->add_block(rotation, first_column + 3, rate * rotation_axes(moved));
}

}  // namespace trammel
