#include "server/plan/approach.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "server/base/check.h"
#include "server/base/units.h"
#include "server/robot/passive_joint.h"

namespace trammel {

namespace {

constexpr double kBumpAngle = from_deg(5);   // source section 3.2.4.2
constexpr double kBumpLength = from_mm(50);  // of a rail
constexpr double kLeastBump = 0.2;           // share of the bump: 1 deg takes up any play
constexpr double kGrid = 1e-4;               // deg, mm: the four decimals of programs

double longest_way(const Joint& joint) {
  return joint.type == JointType::kRevolute ? kBumpAngle : kBumpLength;
}

/// The start of the approach to `q` within the limits; the gears turn as `sides` states.
JointVector start_of(const Chain& robot, const JointVector& q, const Sides& sides) {
  JointVector way(robot.size());
  for (int j = 0; j < robot.size(); ++j) {
    const int side = sides[static_cast<std::size_t>(j)];
    TRAMMEL_CHECK(side == 1 || side == -1);
    way(j) = is_passive(robot.joint(j)) ? 0 : side * longest_way(robot.joint(j));
  }
  JointVector start = q - robot.commanded(way);
  for (int j = 0; j < robot.size(); ++j)
    start(j) = std::clamp(start(j), robot.joint(j).lower, robot.joint(j).upper);
  return start;
}

/// True if the gear of the joint turns far enough from `start` to `q` to take up its play on this
/// side. False for a passive joint, which has no gear.
bool has_way(const Chain& robot, const JointVector& q, const JointVector& start, int joint,
             int side) {
  if (is_passive(robot.joint(joint))) return true;
  return side * robot.gear_angles(q - start)(joint) >= kLeastBump * longest_way(robot.joint(joint));
}

}  // namespace

Sides planned_sides(const Chain& robot, int number) {
  Sides sides;
  // Columns of a Hadamard matrix: joint j uses the binary digits of j + 1, and the last digit
  // reverses all of them.
  for (int j = 0; j < robot.size(); ++j)
    sides.push_back(
        std::popcount(static_cast<unsigned>(number) & static_cast<unsigned>(2 * j + 3)) % 2 == 0
            ? -1
            : 1);
  return sides;
}

Sides possible_sides(const Chain& robot, const JointVector& q, Sides wanted) {
  for (int j = 0; j < robot.size(); ++j) {
    int& side = wanted[static_cast<std::size_t>(j)];
    if (!has_way(robot, q, start_of(robot, q, wanted), j, side)) side = -side;
  }
  return wanted;
}

std::optional<JointVector> bump_pose(const Chain& robot, const JointVector& q, const Sides& sides) {
  JointVector bump = start_of(robot, q, sides);
  for (int j = 0; j < robot.size(); ++j)
    if (!has_way(robot, q, bump, j, sides[static_cast<std::size_t>(j)])) return std::nullopt;
  return bump;
}

std::pair<double, double> approachable_range(const Joint& joint, double lower, double upper) {
  const double grid = joint.type == JointType::kRevolute ? from_deg(kGrid) : from_mm(kGrid);
  const double least = kLeastBump * longest_way(joint) + grid;
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
    q(j) = is_passive(joint) ? 0 : steps * step;
  }
  return q;
}

}  // namespace trammel
