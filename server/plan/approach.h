#pragma once

#include <optional>
#include <utility>
#include <vector>

#include "server/robot/chain.h"

/// The approach of a measuring pose, which decides the side on which play in the gears is taken up.
namespace trammel {

/// The way each gear turns into a pose: +1 rising, -1 falling (PoseContext::direction).
using Sides = std::vector<int>;

/// The sides from which pose `number` (from 0) of a plan is approached: first all from above, then
/// all from below. An even pose and the one after it come from opposite sides in every joint, so
/// each joint comes as often from above as from below. Over 16 poses the patterns of any two of
/// seven joints differ, so the play of one joint can be separated from that of another.
[[nodiscard]] Sides planned_sides(const Chain& robot, int number);

/// `wanted`, with the opposite side for each joint that a limit leaves no room on the wanted side.
[[nodiscard]] Sides possible_sides(const Chain& robot, const JointVector& q, Sides wanted);

/// The pose from which `q` (rad, m) is approached slowly with every gear turning as `sides` say:
/// the "bump" of source section 3.2.4.2, q - side * 5 deg (50 mm for a rail) in the controller's
/// count of the gears, within the limits. Empty if a limit leaves a gear less than 1 deg (10 mm),
/// which does not take up the play.
[[nodiscard]] std::optional<JointVector> bump_pose(const Chain& robot, const JointVector& q,
                                                   const Sides& sides);

/// The part of [lower, upper] (rad, m) in which this joint can be approached from either side, even
/// after rounding to the grid of programs; [lower, upper] if there is none.
[[nodiscard]] std::pair<double, double> approachable_range(const Joint& joint, double lower,
                                                           double upper);

/// `q` rounded to 0.0001 deg (0.0001 mm), the precision of programs, so that the planned, the
/// commanded and the recorded number are equal. Never outside the limits.
[[nodiscard]] JointVector on_program_grid(const Chain& robot, JointVector q);

}  // namespace trammel
