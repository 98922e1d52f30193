#include "server/plan/approach.h"

#include <algorithm>
#include <cmath>

#include "server/base/check.h"
#include "server/base/units.h"

namespace trammel {

namespace {

constexpr double kBumpAngle = from_deg(5);   // source section 3.2.4.2
constexpr double kBumpLength = from_mm(50);  // of a rail
constexpr double kLeastBump = 0.2;           // of the bump: 1 deg takes up any play
constexpr double kGrid = 1e-4;               // deg, mm: the four decimals of programs

}  // namespace

std::optional<JointVector> bump_pose(const Chain& robot, const JointVector& q, int direction) {
  TRAMMEL_CHECK(direction == 1 || direction == -1);
  JointVector way(robot.size());
  for (int j = 0; j < robot.size(); ++j)
    way(j) = direction * (robot.joint(j).type == JointType::kRevolute ? kBumpAngle : kBumpLength);
  JointVector bump = q - robot.commanded(way);
  for (int j = 0; j < robot.size(); ++j) bump(j) = std::clamp(bump(j), robot.joint(j).lower, robot.joint(j).upper);
  const JointVector taken = robot.gear_angles(q - bump);
  for (int j = 0; j < robot.size(); ++j)
    if (taken(j) / way(j) < kLeastBump) return std::nullopt;
  return bump;
}

std::pair<double, double> approachable_range(const Joint& joint, double lower, double upper) {
  const bool revolute = joint.type == JointType::kRevolute;
  const double grid = revolute ? from_deg(kGrid) : from_mm(kGrid);
  const double least = kLeastBump * (revolute ? kBumpAngle : kBumpLength) + grid;
  const double from = std::max(lower + grid, joint.lower + least);
  const double to = std::min(upper - grid, joint.upper - least);
  return from < to ? std::pair(from, to) : std::pair(lower, upper);
}

JointVector on_program_grid(const Chain& robot, JointVector q) {
  for (int j = 0; j < robot.size(); ++j) {
    const Joint& joint = robot.joint(j);
    const double step = joint.type == JointType::kRevolute ? from_deg(kGrid) : from_mm(kGrid);
    double steps = std::round(q(j) / step);
    if (steps * step > joint.upper) steps = std::floor(joint.upper / step);
    if (steps * step < joint.lower) steps = std::ceil(joint.lower / step);
    q(j) = steps * step;
  }
  return q;
}

}  // namespace trammel
