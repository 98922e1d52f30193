#pragma once

#include <Eigen/Dense>
#include <Eigen/Geometry>

/// Poses and small motions. X_AB is frame B seen from frame A; W tracker world, B robot base, F
/// flange, T tool.
namespace trammel {

using Pose = Eigen::Isometry3d;
using Vector3 = Eigen::Vector3d;
using Matrix3 = Eigen::Matrix3d;
/// [translation; rotation vector], both expressed in the frame the name says.
using Vector6 = Eigen::Matrix<double, 6, 1>;
using JointVector = Eigen::VectorXd;

[[nodiscard]] Matrix3 skew(const Vector3& v);
/// Rotation matrix of a rotation vector (rad).
[[nodiscard]] Matrix3 rotation_exp(const Vector3& rotation_vector);
/// Rotation vector of a rotation matrix, length in [0, pi].
[[nodiscard]] Vector3 rotation_log(const Matrix3& R);
/// Left Jacobian of SO(3): rotation_exp(w + dw) = rotation_exp(J dw) rotation_exp(w) to first order
/// in dw.
[[nodiscard]] Matrix3 left_jacobian(const Vector3& w);
/// Tx Ty Tz Rz(gamma) Ry(beta) Rx(alpha), the base transformation of the source, eq. (3.5).
[[nodiscard]] Pose pose_zyx(const Vector3& translation, double gamma, double beta, double alpha);
/// Its gamma, beta, alpha of R, beta at most 90 degrees. There gamma and alpha turn about one axis,
/// and gamma is 0.
[[nodiscard]] Vector3 zyx_angles(const Matrix3& R);
/// True if beta is 90 degrees up or down.
[[nodiscard]] bool is_beta_upright(const Matrix3& R);
[[nodiscard]] Pose make_pose(const Matrix3& R, const Vector3& p);
/// measured - model: [p_measured - p_model; rotation_log(R_measured R_modelᵀ)], in the frame of
/// both poses.
[[nodiscard]] Vector6 pose_difference(const Pose& measured, const Pose& model);
/// Nearest rotation matrix in the Frobenius sense.
[[nodiscard]] Matrix3 nearest_rotation(const Matrix3& M);

}  // namespace trammel
