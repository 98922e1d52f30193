#include "server/robot/inverse_kinematics.h"

#include <algorithm>
#include <cmath>

#include "server/base/check.h"
#include "server/base/units.h"
#include "server/robot/angles.h"
#include "server/robot/flange_motion.h"

namespace trammel {

namespace {

constexpr double kConverged = 1e-10;     // m and rad
constexpr double kSingularValue = 1e-3;  // of the Jacobian, m and rad per rad
constexpr int kMaxIterations = 200;

JointVector clamped(const Chain& chain, JointVector q) {
  for (int i = 0; i < chain.size(); ++i)
    q(i) = std::clamp(q(i), chain.joint(i).lower, chain.joint(i).upper);
  return q;
}

struct Descent {
  JointVector q;
  double error = 0;
  int iterations = 0;
};

/// A row and a column for each joint.
using JointMatrix =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxJoints, kMaxJoints>;

Descent descend(const Chain& chain, const Pose& X_BF, const JointVector& start,
                bool within_limits) {
  const auto keep = [&](const JointVector& q) { return within_limits ? clamped(chain, q) : q; };
  const JointMatrix identity = JointMatrix::Identity(chain.size(), chain.size());
  Descent now{keep(start), 0, 0};
  FlangeMotion motion = flange_motion(chain, now.q);
  Vector6 e = pose_difference(X_BF, motion.X_BF);
  now.error = e.norm();
  double damping = 1e-3;
  while (now.iterations < kMaxIterations && now.error > kConverged) {
    ++now.iterations;
    auto J = motion.jacobian;
    // A joint at its limit that the step would push beyond it is held.
    for (int pass = 0; within_limits && pass < 2; ++pass) {
      const JointArray push = J.transpose() * e;
      for (int i = 0; i < chain.size(); ++i) {
        if ((now.q(i) <= chain.joint(i).lower && push(i) < 0) ||
            (now.q(i) >= chain.joint(i).upper && push(i) > 0)) {
          J.col(i).setZero();
        }
      }
    }
    const JointMatrix normal = J.transpose() * J + damping * identity;
    const JointArray gradient = J.transpose() * e;
    const JointVector q = keep(now.q + normal.ldlt().solve(gradient));
    FlangeMotion next = flange_motion(chain, q);
    const Vector6 e_new = pose_difference(X_BF, next.X_BF);
    if (e_new.norm() < now.error) {
      const bool stalled = (q - now.q).norm() < 1e-14;
      now.q = q;
      motion = next;
      e = e_new;
      now.error = e.norm();
      damping = std::max(damping * 0.1, 1e-14);
      if (stalled) break;
    } else {
      damping *= 10;
      if (damping > 1e8) break;
    }
  }
  return now;
}

/// True if the smallest singular value of the Jacobian is below kSingularValue. Then J Jᵀ (or Jᵀ J,
/// if that is smaller) minus kSingularValue² is not positive definite.
bool is_singular(const Chain& chain, const JointVector& q) {
  const auto J = flange_motion(chain, q).jacobian;
  JointMatrix square;
  if (J.rows() <= J.cols()) {
    square = J * J.transpose();
  } else {
    square = J.transpose() * J;
  }
  square.diagonal().array() -= kSingularValue * kSingularValue;
  return square.llt().info() != Eigen::Success;
}

}  // namespace

InverseResult judged_joints(const Chain& chain, const JointVector& q, int iterations) {
  InverseResult result{InverseStatus::kOk, q, iterations};
  if (chain.joint_outside_limits(q)) {
    result.status = InverseStatus::kJointLimit;
  } else if (is_singular(chain, q)) {
    result.status = InverseStatus::kSingular;
  }
  return result;
}

InverseResult inverse_kinematics(const Chain& chain, const Pose& X_BF, const JointVector& seed) {
  TRAMMEL_CHECK(seed.size() == chain.size());
  const Descent inside = descend(chain, X_BF, seed, true);
  if (inside.error <= kConverged) return judged_joints(chain, inside.q, inside.iterations);
  const Descent free = descend(chain, X_BF, seed, false);
  const int iterations = inside.iterations + free.iterations;
  if (free.error <= kConverged) return judged_joints(chain, free.q, iterations);
  return {InverseStatus::kUnreachable, inside.q, iterations};
}

bool has_spherical_wrist(const Chain& chain) {
  if (chain.size() != 6) return false;
  constexpr double kTolerance = 1e-9;
  const auto link = [&](int i) { return chain.joint(i).link; };
  const auto right_angle = [&](int i) { return std::abs(std::cos(link(i).alpha)) < kTolerance; };
  for (int i = 0; i < 6; ++i) {
    if (chain.joint(i).type != JointType::kRevolute || std::abs(link(i).beta) > kTolerance)
      return false;
  }
  return right_angle(0) && std::abs(std::sin(link(1).alpha)) < kTolerance &&
         std::cos(link(1).alpha) > 0 && right_angle(2) && right_angle(3) && right_angle(4) &&
         std::abs(link(3).a) < kTolerance && std::abs(link(4).a) < kTolerance &&
         std::abs(link(4).d) < kTolerance && link(1).a > kTolerance;
}

namespace {

/// theta of joints 4 to 6 that turn frame 3 into frame 5:
/// R = Rz(4) Rx(alpha4) Rz(5) Rx(alpha5) Rz(6).
void turn_wrist(const Chain& chain, const Matrix3& R, bool negative_5,
                std::array<double, 6>& theta) {
  const auto link = [&](int i) { return chain.joint(i).link; };
  const double s4 = std::sin(link(3).alpha);
  const double s5 = std::sin(link(4).alpha);
  // The third column is (cos4 A, sin4 A, C), A = sin(alpha5) sin5, C = -sin(alpha4) sin(alpha5)
  // cos5.
  const double sine_5 = (negative_5 ? -1.0 : 1.0) * std::hypot(R(0, 2), R(1, 2));
  const double A = s5 * sine_5;
  theta[4] = std::atan2(sine_5, -R(2, 2) / (s4 * s5));
  theta[3] = std::abs(A) < 1e-12 ? 0.0 : std::atan2(R(1, 2) / A, R(0, 2) / A);
  const Matrix3 R_up_to_5 = (Eigen::AngleAxisd(theta[3], Vector3::UnitZ()) *
                             Eigen::AngleAxisd(link(3).alpha, Vector3::UnitX()) *
                             Eigen::AngleAxisd(theta[4], Vector3::UnitZ()) *
                             Eigen::AngleAxisd(link(4).alpha, Vector3::UnitX()))
                                .toRotationMatrix();
  const Matrix3 R_6 = R_up_to_5.transpose() * R;
  theta[5] = std::atan2(R_6(1, 0), R_6(0, 0));
}

/// theta (not joint values) of one branch; empty when the wrist centre is out of reach.
/// The wrist centre, seen in frame 1, is a planar two-link problem: lengths a2 and hypot(a3, d4).
std::optional<std::array<double, 6>> branch(const Chain& chain, const Pose& X_BF,
                                            bool behind_axis_1, bool behind_arm, bool negative_5) {
  const auto link = [&](int i) { return chain.joint(i).link; };
  Pose X_B5 = X_BF;  // frame 6 undone up to Rz(theta6): its origin is the wrist centre
  X_B5.linear() =
      X_BF.linear() * Eigen::AngleAxisd(-link(5).alpha, Vector3::UnitX()).toRotationMatrix();
  const Vector3 wrist =
      X_BF.translation() - X_B5.linear().col(0) * link(5).a - X_B5.linear().col(2) * link(5).d;

  std::array<double, 6> theta{};
  const double offset = (link(1).d + link(2).d) / std::sin(link(0).alpha);
  const double radius = std::hypot(wrist.x(), wrist.y());
  if (radius < 1e-12 || std::abs(offset) > radius) return std::nullopt;
  const double azimuth = std::atan2(wrist.y(), wrist.x());
  const double side = std::asin(offset / radius);
  theta[0] = behind_axis_1 ? azimuth + kPi - side : azimuth + side;

  const Matrix3 R_B1 = (Eigen::AngleAxisd(theta[0], Vector3::UnitZ()) *
                        Eigen::AngleAxisd(link(0).alpha, Vector3::UnitX()))
                           .toRotationMatrix();
  const Vector3 p_B1 =
      link(0).d * Vector3::UnitZ() + link(0).a * Vector3(std::cos(theta[0]), std::sin(theta[0]), 0);
  const Vector3 p = R_B1.transpose() * (wrist - p_B1);
  const double upper = link(1).a;
  const double fore_y = -std::sin(link(2).alpha) * link(3).d;
  const double fore = std::hypot(link(2).a, fore_y);
  const double cosine =
      (p.x() * p.x() + p.y() * p.y() - upper * upper - fore * fore) / (2 * upper * fore);
  if (std::abs(cosine) > 1) return std::nullopt;
  // There are two elbows. The sign of this sine selects the one with the wrist in front of the
  // lower arm. The sign depends on the orientation of frame 1 and on the side of axis 1 on which
  // the arm works.
  const double forward =
      (R_B1.transpose() * Vector3(std::cos(theta[0]), std::sin(theta[0]), 0)).x() *
      (std::sin(link(0).alpha) < 0 ? 1.0 : -1.0);
  const bool positive_sine = (forward > 0) != behind_arm;
  const double sine = (positive_sine ? 1.0 : -1.0) * std::sqrt(std::max(0.0, 1 - cosine * cosine));
  theta[2] = std::atan2(sine, cosine) - std::atan2(fore_y, link(2).a);
  theta[1] = std::atan2(p.y(), p.x()) - std::atan2(fore * sine, upper + fore * cosine);

  const Matrix3 R_B3 = R_B1 * (Eigen::AngleAxisd(theta[1], Vector3::UnitZ()) *
                               Eigen::AngleAxisd(link(1).alpha, Vector3::UnitX()) *
                               Eigen::AngleAxisd(theta[2], Vector3::UnitZ()) *
                               Eigen::AngleAxisd(link(2).alpha, Vector3::UnitX()))
                                  .toRotationMatrix();
  const Matrix3 R = R_B3.transpose() * X_B5.linear();
  turn_wrist(chain, R, negative_5, theta);
  return theta;
}

}  // namespace

Result<InverseResult> inverse_kinematics(const Chain& chain, const Pose& X_BF, int conf,
                                         const std::optional<JointVector>& near) {
  if (!has_spherical_wrist(chain)) {
    return refused("robot {}: no spherical wrist, so a branch (conf) does not say enough",
                   chain.name())
        .of("conf")
        .next("give joints as a seed");
  }
  if (conf < 0 || conf > 7)
    return refused("conf is {}, limits 0 and 7", conf).of("conf").beyond(conf, conf < 0 ? 0 : 7);
  const auto q = joints_of_branch(chain, X_BF, conf, near);
  if (!q) return InverseResult{InverseStatus::kUnreachable, near.value_or(JointVector::Zero(6)), 0};
  return judged_joints(chain, *q, 0);
}

std::optional<JointVector> joints_of_branch(const Chain& chain, const Pose& X_BF, int conf,
                                            const std::optional<JointVector>& near) {
  const auto theta = branch(chain, X_BF, (conf & 4) != 0, (conf & 2) != 0, (conf & 1) != 0);
  if (!theta) return std::nullopt;
  return joints_of_angles(chain, *theta, near);
}

Result<int> branch_of(const Chain& chain, const JointVector& q) {
  TRAMMEL_CHECK(q.size() == chain.size());
  if (!has_spherical_wrist(chain))
    return refused("robot {}: no spherical wrist, so no branches", chain.name()).of("conf");
  const Pose X_BF = chain.flange_pose(q);
  int best = 0;
  double least = std::numeric_limits<double>::infinity();
  for (int conf = 0; conf < 8; ++conf) {
    const auto candidate = joints_of_branch(chain, X_BF, conf, q);
    if (!candidate) continue;
    const double distance = (*candidate - q).norm();
    if (distance < least) {
      least = distance;
      best = conf;
    }
  }
  return best;
}

}  // namespace trammel
