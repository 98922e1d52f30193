#include "tests/support/hidden_robot.h"

#include <cmath>
#include <numbers>
#include <vector>

namespace trammel::hidden {

namespace {

using Eigen::Matrix3d;
using Eigen::Matrix4d;
using Eigen::Vector3d;

constexpr double kRight = std::numbers::pi / 2;
constexpr double kWeight = 9.80665;  // N/kg
constexpr int kMostRounds = 60;
constexpr double kSettled = 1e-14;  // rad

Matrix4d link_frame(const Link& link, double q) {
  const double ct = std::cos(link.theta + q);
  const double st = std::sin(link.theta + q);
  const double ca = std::cos(link.alpha);
  const double sa = std::sin(link.alpha);
  Matrix4d frame;
  frame << ct, -st * ca, st * sa, link.a * ct,  //
      st, ct * ca, -ct * sa, link.a * st,       //
      0, sa, ca, link.parallel ? 0 : link.d,    //
      0, 0, 0, 1;
  if (link.parallel) {
    const double cb = std::cos(link.beta);
    const double sb = std::sin(link.beta);
    Matrix4d tilt = Matrix4d::Identity();
    tilt(0, 0) = cb;
    tilt(0, 2) = sb;
    tilt(2, 0) = -sb;
    tilt(2, 2) = cb;
    frame = frame * tilt;
  }
  return frame;
}

Vector3d origin(const Matrix4d& frame) { return frame.block<3, 1>(0, 3); }
Matrix3d axes(const Matrix4d& frame) { return frame.block<3, 3>(0, 0); }

/// The angles by which gearboxes have turned and links have bent.
struct Deflection {
  Joints joints = Joints::Zero();
  std::array<Matrix4d, kJoints> bends;
  Matrix4d tilt = Matrix4d::Identity();
  bool bent = false;
  Deflection() { bends.fill(Matrix4d::Identity()); }
};

/// frames[0] is the base, frames[i] the frame behind link i.
std::array<Matrix4d, kJoints + 1> frames_of(const Arm& arm, const Joints& q,
                                            const Deflection& deflection) {
  std::array<Matrix4d, kJoints + 1> frames;
  frames[0] = arm.base * deflection.tilt;
  for (std::size_t i = 0; i < kJoints; ++i) {
    const auto joint = static_cast<Eigen::Index>(i);
    frames[i + 1] =
        frames[i] * arm.bearings[i] * link_frame(arm.links[i], q(joint) + deflection.joints(joint));
    if (deflection.bent) frames[i + 1] = frames[i + 1] * deflection.bends[i];
  }
  return frames;
}

Vector3d weight_of(const Load& load) { return {0, 0, -kWeight * load.mass_kg}; }

/// The weights: the payload at the last frame, each link at its own.
struct Weight {
  Vector3d at, force;
  std::size_t last;  ///< joint that still feels it
};

std::vector<Weight> weights_in(const std::array<Matrix4d, kJoints + 1>& frames, const Arm& arm) {
  std::vector<Weight> all = {{origin(frames[kJoints]) + axes(frames[kJoints]) * arm.load.cog_mm,
                              weight_of(arm.load), kJoints - 1}};
  for (std::size_t i = 0; i < kJoints; ++i) {
    if (arm.weights[i].mass_kg == 0) continue;
    all.push_back({origin(frames[i + 1]) + axes(frames[i + 1]) * arm.weights[i].cog_mm,
                   weight_of(arm.weights[i]), i});
  }
  return all;
}

/// Torque of a spring whose pins are at (fixed, 0) and, turned by the angle, at (moving, 0):
/// computed from the length between the pins.
double torque_of(const Spring& spring, double q) {
  if (spring.fixed_mm == 0) return 0;
  const double angle = q + spring.phase;
  const double length =
      std::sqrt(spring.fixed_mm * spring.fixed_mm + spring.moving_mm * spring.moving_mm -
                2 * spring.fixed_mm * spring.moving_mm * std::cos(angle));
  const double pull = spring.force_N + spring.stiffness_N_mm * (length - spring.rest_mm);
  return -pull * spring.fixed_mm * spring.moving_mm * std::sin(angle) /
         length;  // -d(length)/d(angle)
}

Joints moments_in(const std::array<Matrix4d, kJoints + 1>& frames, const Arm& arm,
                  const Joints& q) {
  Joints moments = Joints::Zero();
  for (const Weight& weight : weights_in(frames, arm)) {
    for (std::size_t i = 0; i <= weight.last; ++i) {
      moments(static_cast<Eigen::Index>(i)) +=
          frames[i].block<3, 1>(0, 2).dot((weight.at - origin(frames[i])).cross(weight.force));
    }
  }
  moments(1) += torque_of(arm.spring, q(1));
  return moments;
}

/// The tilt of the foot under the moment of all that weighs.
Matrix4d tilt_in(const std::array<Matrix4d, kJoints + 1>& frames, const Arm& arm) {
  Vector3d moment = Vector3d::Zero();
  for (const Weight& weight : weights_in(frames, arm))
    moment += (weight.at - origin(arm.base)).cross(weight.force);
  const Vector3d in_base = axes(arm.base).transpose() * moment;
  const Vector3d turn(arm.foot.x() * in_base.x(), arm.foot.y() * in_base.y(), 0);
  Matrix4d tilt = Matrix4d::Identity();
  if (turn.norm() > 0)
    tilt.block<3, 3>(0, 0) = Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix();
  return tilt;
}

/// A beam that is a little thinner towards its far end, clamped at its joint, pulled and turned at
/// the far end.
Matrix4d bend_of(double flex, const Matrix4d& start, const Matrix4d& end, const Vector3d& cog,
                 const Vector3d& force) {
  const Matrix3d to_end = axes(end).transpose();
  const Vector3d span = to_end * (origin(end) - origin(start));
  const double length = span.norm();
  const Vector3d along = span / length;
  const Vector3d pull = to_end * force;
  const Vector3d across = pull - along * along.dot(pull);
  const Vector3d turning = (to_end * (cog - origin(end))).cross(pull);
  const Vector3d moment = turning - along * along.dot(turning);
  // The flexibility is 1.15 at the far end and 0.85 at the joint. These are its integrals times 1,
  // s, s2, where s is the distance from the far end.
  const double zeroth = flex * length;
  const double first = flex * length * length * (1.15 / 2 - 0.3 / 3);
  const double second = flex * length * length * length * (1.15 / 3 - 0.3 / 4);
  const Vector3d slope = moment * zeroth + along.cross(across) * first;
  Matrix4d bend = Matrix4d::Identity();
  bend.block<3, 1>(0, 3) = moment.cross(along) * first + across * second;
  if (slope.norm() > 0) {
    bend.block<3, 3>(0, 0) = Eigen::AngleAxisd(slope.norm(), slope.normalized()).toRotationMatrix();
  }
  return bend;
}

bool bends(const Arm& arm) {
  for (const double flex : arm.flex) {
    if (flex != 0) return true;
  }
  return false;
}

Deflection settled(const Arm& arm, const Joints& q) {
  Deflection deflection;
  deflection.bent = bends(arm);
  if (arm.give.isZero(0) && arm.foot.isZero(0) && !deflection.bent) return deflection;
  const Vector3d force = weight_of(arm.load);
  for (int round = 0; round < kMostRounds; ++round) {
    const auto frames = frames_of(arm, q, deflection);
    const Joints next = arm.give.cwiseProduct(moments_in(frames, arm, q));
    double moved = (next - deflection.joints).cwiseAbs().maxCoeff();
    deflection.joints = next;
    deflection.tilt = tilt_in(frames, arm);
    const Vector3d cog = origin(frames[kJoints]) + axes(frames[kJoints]) * arm.load.cog_mm;
    for (std::size_t i = 0; deflection.bent && i < kJoints; ++i) {
      if (arm.flex[i] == 0) continue;
      const Matrix4d straight = frames[i] * arm.bearings[i] *
                                link_frame(arm.links[i], q(static_cast<Eigen::Index>(i)) + next(i));
      const Matrix4d bend = bend_of(arm.flex[i], frames[i], straight, cog, force);
      moved = std::max(moved, (bend - deflection.bends[i]).block<3, 3>(0, 0).cwiseAbs().maxCoeff());
      deflection.bends[i] = bend;
    }
    if (moved < kSettled) break;
  }
  return deflection;
}

}  // namespace

Arm drawn_arm() {
  Arm arm;
  arm.links = {{{0, 780, 320, -kRight, 0, false},
                {-kRight, 0, 1280, 0, 0, true},
                {0, 0, 200, -kRight, 0, false},
                {2 * kRight, 1142, 0, -kRight, 0, false},
                {0, 0, 0, kRight, 0, false},
                {0, 200, 0, 0, 0, false}}};
  return arm;
}

Matrix4d motion(const Vector3d& shift_mm, double about_z, double about_y, double about_x) {
  Matrix4d frame = Matrix4d::Identity();
  frame.block<3, 3>(0, 0) = (Eigen::AngleAxisd(about_z, Vector3d::UnitZ()) *
                             Eigen::AngleAxisd(about_y, Vector3d::UnitY()) *
                             Eigen::AngleAxisd(about_x, Vector3d::UnitX()))
                                .toRotationMatrix();
  frame.block<3, 1>(0, 3) = shift_mm;
  return frame;
}

Joints load_moments(const Arm& arm, const Joints& q) {
  return moments_in(frames_of(arm, q, settled(arm, q)), arm, q);
}

Matrix4d tool_frame(const Arm& arm, const Joints& q) {
  return frames_of(arm, q, settled(arm, q))[kJoints] * arm.tool;
}

const std::vector<ArmParameter>& arm_parameters() {
  static const std::vector<ArmParameter> all = [] {
    std::vector<ArmParameter> list;
    for (const char* name : {"x0", "y0", "z0"}) list.push_back({name, "base", 2});
    for (const char* name : {"gamma0", "beta0", "alpha0"}) list.push_back({name, "base", 5e-3});
    for (std::size_t i = 0; i < kJoints; ++i) {
      const std::string number = std::to_string(i + 1);
      const bool parallel = drawn_arm().links[i].parallel;
      list.push_back({"q" + number, "geometry", 5e-3});
      if (!parallel) list.push_back({"d" + number, "geometry", 2});
      list.push_back({"a" + number, "geometry", 2});
      list.push_back({"alpha" + number, "geometry", 5e-3});
      if (parallel) list.push_back({"beta" + number, "geometry", 5e-3});
    }
    for (std::size_t i = 0; i < kJoints; ++i)
      list.push_back({"C" + std::to_string(i + 1), "compliance", 1e-8});
    return list;
  }();
  return all;
}

Arm changed(Arm arm, const Eigen::VectorXd& values) {
  arm.base = arm.base * motion(values.head<3>(), values(3), values(4), values(5));
  Eigen::Index next = 6;
  for (Link& link : arm.links) {
    link.theta += values(next++);
    if (!link.parallel) link.d += values(next++);
    link.a += values(next++);
    link.alpha += values(next++);
    if (link.parallel) link.beta += values(next++);
  }
  arm.give += values.segment<kJoints>(next);
  return arm;
}

}  // namespace trammel::hidden
