#include "server/robot/lead_in.h"

#include <cmath>

#include "server/base/units.h"
#include "server/robot/inverse_kinematics.h"

namespace trammel {

namespace {

constexpr double kStill = 1e-6;  // rad (m): a gear with a smaller turn counts as still

/// The joints at the start of the line along the tool's axis.
std::optional<JointVector> backed_off(const Chain& robot, const JointVector& q, const Pose& X_FT,
                                      double back_off) {
  const Pose X_BT = robot.flange_pose(q) * X_FT * Eigen::Translation3d(0, 0, -back_off);
  const InverseResult found = inverse_kinematics(robot, X_BT * X_FT.inverse(), q);
  if (found.status != InverseStatus::kOk) return std::nullopt;
  return found.q;
}

/// The turn of the gear before the line. On the line it turns by `on_line`.
double before_line(const TakeUp& one, double on_line, int side) {
  return std::abs(on_line) >= one.way ? 0 : side * (one.way - std::abs(on_line));
}

/// The lead-in in which the gears that the line does not turn come from their side, or from the
/// other one.
std::optional<LeadIn> led_in(const Chain& robot, const JointVector& q, const JointVector& back,
                             const std::vector<TakeUp>& take_ups, bool other_side) {
  LeadIn made;
  made.sides.assign(static_cast<std::size_t>(robot.size()), 0);
  const JointVector on_line = robot.gear_angles(q - back);
  JointVector first = JointVector::Zero(robot.size());
  for (const TakeUp& one : take_ups) {
    const double turns = on_line(one.joint);
    const int free = other_side ? -one.side : one.side;
    const int side = std::abs(turns) < kStill ? free : turns > 0 ? 1 : -1;
    made.sides[static_cast<std::size_t>(one.joint)] = side;
    first(one.joint) = before_line(one, turns, side);
  }
  if (first.norm() > 0) made.offsets.emplace_back(back - robot.commanded(first) - q);
  made.offsets.emplace_back(back - q);
  for (const JointVector& offset : made.offsets) {
    if (robot.joint_outside_limits(q + offset)) return std::nullopt;
  }
  return made;
}

}  // namespace

std::optional<LeadIn> lead_in(const Chain& robot, const JointVector& q, const Pose& X_FT,
                              const std::vector<TakeUp>& take_ups, double back_off) {
  if (take_ups.empty()) return std::nullopt;
  const std::optional<JointVector> back = backed_off(robot, q, X_FT, back_off);
  if (!back) return std::nullopt;
  if (auto made = led_in(robot, q, *back, take_ups, false)) return made;
  return led_in(robot, q, *back, take_ups, true);
}

}  // namespace trammel
