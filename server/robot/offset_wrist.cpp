#include "server/robot/offset_wrist.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "server/base/check.h"
#include "server/base/units.h"
#include "server/robot/angles.h"

namespace trammel {

namespace {

constexpr double kTolerance = 1e-9;  // m; of a sine or cosine
constexpr double kReach = 1e-9;  // a cosine may exceed 1 by this much at the edge of the workspace

Matrix3 about_x(double angle) {
  return Eigen::AngleAxisd(angle, Vector3::UnitX()).toRotationMatrix();
}
Matrix3 about_z(double angle) {
  return Eigen::AngleAxisd(angle, Vector3::UnitZ()).toRotationMatrix();
}

/// The angle with this cosine; empty beyond 1.
std::optional<double> arc_cosine(double cosine) {
  if (std::abs(cosine) > 1 + kReach) return std::nullopt;
  return std::acos(std::clamp(cosine, -1.0, 1.0));
}

}  // namespace

bool has_offset_wrist(const Chain& chain) {
  if (chain.size() != 6) return false;
  const auto link = [&](int i) { return chain.joint(i).link; };
  const auto right_angle = [&](int i) { return std::abs(std::cos(link(i).alpha)) < kTolerance; };
  const auto parallel = [&](int i) {
    return std::abs(std::sin(link(i).alpha)) < kTolerance && std::cos(link(i).alpha) > 0;
  };
  for (int i = 0; i < 6; ++i) {
    if (chain.joint(i).type != JointType::kRevolute || std::abs(link(i).beta) > kTolerance)
      return false;
    if (i != 1 && i != 2 && std::abs(link(i).a) > kTolerance) return false;
  }
  return right_angle(0) && parallel(1) && parallel(2) && right_angle(3) && right_angle(4) &&
         std::abs(link(1).a) > kTolerance && std::abs(link(2).a) > kTolerance &&
         std::abs(link(4).d) > kTolerance;
}

std::optional<JointVector> joints_of_offset_wrist(const Chain& chain, const Pose& X_BF, int branch,
                                                  const JointVector& near) {
  TRAMMEL_CHECK(branch >= 0 && branch < 8 && near.size() == 6);
  const auto link = [&](int i) { return chain.joint(i).link; };
  const double s1 = std::sin(link(0).alpha), s4 = std::sin(link(3).alpha),
               s5 = std::sin(link(4).alpha);
  std::array<double, 6> theta{};
  const Matrix3 R_B6 = X_BF.linear() * about_x(-link(5).alpha);  // its z is axis 6
  const Vector3 p_B5 = X_BF.translation() - link(5).d * R_B6.col(2);

  // Along the parallel axes, whose direction is (s1 sin 1, -s1 cos 1, 0), origin 5 lies at the sum
  // of the offsets.
  const double along = link(1).d + link(2).d + link(3).d;
  const double radius = std::hypot(p_B5.x(), p_B5.y());
  if (radius < kTolerance || std::abs(along) > radius) return std::nullopt;
  const double side = std::asin(along / (s1 * radius)), azimuth = std::atan2(p_B5.y(), p_B5.x());
  theta[0] = (branch & 4) != 0 ? azimuth + kPi - side : azimuth + side;
  const Matrix3 R_B1 = about_z(theta[0]) * about_x(link(0).alpha);
  const Vector3 parallel_B = R_B1.col(2);

  // Seen in frame 6 the parallel axes are (cos 6 sin 5, -sin 6 sin 5, -s5 cos 5), times s4.
  const Vector3 parallel_6 = s4 * (R_B6.transpose() * parallel_B);
  const double sine_5 = ((branch & 1) != 0 ? -1 : 1) * std::hypot(parallel_6.x(), parallel_6.y());
  theta[4] = std::atan2(sine_5, -s5 * parallel_6.z());
  theta[5] = std::abs(sine_5) < kTolerance
                 ? (chain.transmission() * near)(5) + link(5).theta
                 : std::atan2(-parallel_6.y() / sine_5, parallel_6.x() / sine_5);

  const Matrix3 R_B4 = R_B6 * about_z(-theta[5]) * about_x(-link(4).alpha) * about_z(-theta[4]);
  const Matrix3 R_14 =
      R_B1.transpose() * R_B4 * about_x(-link(3).alpha);  // a turn by joints 2, 3 and 4 together
  const Vector3 p_B4 = p_B5 - link(4).d * R_B4.col(2);
  const Vector3 p_1 = R_B1.transpose() * (p_B4 - Vector3(0, 0, link(0).d));
  const double upper = link(1).a, fore = link(2).a;
  const std::optional<double> elbow = arc_cosine(
      (p_1.x() * p_1.x() + p_1.y() * p_1.y() - upper * upper - fore * fore) / (2 * upper * fore));
  if (!elbow) return std::nullopt;
  theta[2] = (branch & 2) != 0 ? -*elbow : *elbow;
  theta[1] = std::atan2(p_1.y(), p_1.x()) -
             std::atan2(fore * std::sin(theta[2]), upper + fore * std::cos(theta[2]));
  theta[3] = std::atan2(R_14(1, 0), R_14(0, 0)) - theta[1] - theta[2];
  return joints_of_angles(chain, theta, near);
}

}  // namespace trammel
