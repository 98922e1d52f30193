#include "server/robot/pose.h"

#include <cmath>

namespace trammel {

Matrix3 skew(const Vector3& v) {
  Matrix3 m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

Matrix3 rotation_exp(const Vector3& rotation_vector) {
  const double angle = rotation_vector.norm();
  if (angle < 1e-12) return nearest_rotation(Matrix3::Identity() + skew(rotation_vector));
  return Eigen::AngleAxisd(angle, rotation_vector / angle).toRotationMatrix();
}

Vector3 rotation_log(const Matrix3& R) {
  Eigen::Quaterniond q(R);
  if (q.w() < 0) q.coeffs() *= -1;
  const double sine = q.vec().norm();
  if (sine < 1e-12) return 2.0 * q.vec();
  return (2.0 * std::atan2(sine, q.w()) / sine) * q.vec();
}

Matrix3 left_jacobian(const Vector3& w) {
  const double angle = w.norm();
  const Matrix3 W = skew(w);
  if (angle < 1e-4) return Matrix3::Identity() + 0.5 * W + W * W / 6;
  const double square = angle * angle;
  return Matrix3::Identity() + (1 - std::cos(angle)) / square * W +
         (angle - std::sin(angle)) / (square * angle) * W * W;
}

Pose make_pose(const Matrix3& R, const Vector3& p) {
  Pose X = Pose::Identity();
  X.linear() = R;
  X.translation() = p;
  return X;
}

Pose pose_zyx(const Vector3& translation, double gamma, double beta, double alpha) {
  const Matrix3 R =
      (Eigen::AngleAxisd(gamma, Vector3::UnitZ()) * Eigen::AngleAxisd(beta, Vector3::UnitY()) *
       Eigen::AngleAxisd(alpha, Vector3::UnitX()))
          .toRotationMatrix();
  return make_pose(R, translation);
}

bool is_beta_upright(const Matrix3& R) { return std::hypot(R(0, 0), R(1, 0)) < 1e-9; }

Vector3 zyx_angles(const Matrix3& R) {
  const double beta = std::atan2(-R(2, 0), std::hypot(R(0, 0), R(1, 0)));
  if (is_beta_upright(R)) return {0, beta, std::atan2(-R(1, 2), R(1, 1))};
  return {std::atan2(R(1, 0), R(0, 0)), beta, std::atan2(R(2, 1), R(2, 2))};
}

Vector6 pose_difference(const Pose& measured, const Pose& model) {
  Vector6 difference;
  difference.head<3>() = measured.translation() - model.translation();
  difference.tail<3>() = rotation_log(measured.linear() * model.linear().transpose());
  return difference;
}

Matrix3 nearest_rotation(const Matrix3& M) {
  const Eigen::JacobiSVD<Matrix3> svd(M, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Matrix3 D = Matrix3::Identity();
  D(2, 2) = (svd.matrixU() * svd.matrixV().transpose()).determinant();
  return svd.matrixU() * D * svd.matrixV().transpose();
}

}  // namespace trammel
