#include "server/robot/wrist.h"

#include <cmath>
#include <vector>

#include "server/robot/flange_motion.h"

namespace trammel {

namespace {

constexpr std::size_t kTurning = 6;
constexpr double kRightAngle = 1e-9;  // cosine of a twist that counts as 90 deg
constexpr double kLeastOther =
    1e-2;  // singular value, m or rad per rad: below it another part of the arm is singular

std::vector<int> turning_joints(const Chain& chain) {
  std::vector<int> turning;
  for (int j = 0; j < chain.size(); ++j) {
    if (chain.joint(j).type == JointType::kRevolute) turning.push_back(j);
  }
  return turning;
}

bool crosses_next_at_right_angle(const Joint& joint) {
  return std::abs(std::cos(joint.link.alpha)) < kRightAngle &&
         std::abs(joint.link.beta) < kRightAngle;
}

}  // namespace

std::optional<WristOpening> wrist_opening(const Chain& chain, const JointVector& q, double widest) {
  const std::vector<int> turning = turning_joints(chain);
  if (turning.size() != kTurning) return std::nullopt;
  const int fourth = turning[3], fifth = turning[4];
  if (!crosses_next_at_right_angle(chain.joint(fourth)) ||
      !crosses_next_at_right_angle(chain.joint(fifth)))
    return std::nullopt;
  const double theta = chain.transmission().row(fifth).dot(q) + chain.joint(fifth).link.theta;
  WristOpening wrist;
  wrist.angle = std::asin(std::sin(theta));
  if (std::abs(wrist.angle) > widest) return std::nullopt;
  wrist.by_joint = (std::cos(theta) < 0 ? -1.0 : 1.0) * chain.transmission().row(fifth).transpose();
  JointVector closed = q;
  closed(fifth) -= wrist.angle / wrist.by_joint(fifth);
  const auto all = flange_motion(chain, closed).jacobian;
  Eigen::Matrix<double, 6, 6> J;
  for (std::size_t k = 0; k < kTurning; ++k)
    J.col(static_cast<Eigen::Index>(k)) = all.col(turning[k]);
  const Eigen::JacobiSVD<Eigen::Matrix<double, 6, 6>> svd(J, Eigen::ComputeFullV);
  if (svd.singularValues()(4) < kLeastOther) return std::nullopt;
  wrist.idle = JointVector::Zero(chain.size());
  for (std::size_t k = 0; k < kTurning; ++k)
    wrist.idle(turning[k]) = svd.matrixV()(static_cast<Eigen::Index>(k), 5);
  return wrist;
}

JointVector turned_idly(const Chain& chain, const JointVector& q, const WristOpening& wrist,
                        double joint_4) {
  const int fourth = turning_joints(chain)[3];
  return q + (joint_4 - q(fourth)) / wrist.idle(fourth) * wrist.idle;
}

}  // namespace trammel
