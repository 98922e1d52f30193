#include "server/plan/contact_posture.h"

#include <algorithm>

namespace trammel {

namespace {

constexpr int kSteps = 50;
constexpr double kReached = 1e-6;  // m
constexpr double kLongest = 0.3;   // rad or m: a longer step leaves what the derivative describes
constexpr double kDamping = 1e-9;  // m²: keeps steps finite where the arm is stretched

}  // namespace

std::optional<JointVector> contact_posture(const Chain& robot, const Vector3& p_F,
                                           const Vector3& p_B, JointVector q) {
  for (int k = 0; k < kSteps; ++k) {
    const Vector3 missing = p_B - robot.flange_pose(q) * p_F;
    if (missing.norm() < kReached) {
      if (robot.joint_outside_limits(q)) return std::nullopt;
      return q;
    }
    const Eigen::Matrix3Xd J = robot.jacobian(q, p_F).topRows<3>();
    const Matrix3 square = J * J.transpose() + kDamping * Matrix3::Identity();
    const JointVector step = J.transpose() * square.ldlt().solve(missing);
    q += step * std::min(1.0, kLongest / std::max(kReached, step.norm()));
  }
  return std::nullopt;
}

}  // namespace trammel
