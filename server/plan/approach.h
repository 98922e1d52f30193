#pragma once

#include <optional>
#include <utility>
#include <vector>

#include "server/robot/chain.h"

/// The approach of a measuring pose, so that it is known from which side play in the gears is
/// taken up.
namespace trammel {

/// The way each gear turns into a pose: +1 rising, -1 falling (PoseContext::direction).
using Sides = std::vector<int>;

/// The sides from which pose `number` (from 0) of a plan is approached: all from above first, then
/// all from below. An even pose and the one after it come from opposite sides in every joint, so
/// each joint comes as often from above as from below. Over 16 poses no two of seven joints come
/// together, which tells the play of one from that of another.
[[nodiscard]] Sides planned_sides(const Chain& robot, int number);

/// `wanted`, with the other side for each joint that a limit leaves no way of the wanted one.
[[nodiscard]] Sides possible_sides(const Chain& robot, const JointVector& q, Sides wanted);

/// The pose from which `q` (rad, m) is approached slowly with every gear turning as `sides` say:
/// the "bump" of source section 3.2.4.2, q - side * 5 deg (50 mm of a rail) where the controller
/// counts the gears, kept within the limits. Nothing where a limit leaves a gear less than 1 deg
/// (10 mm) to move: too little to take up the play.
[[nodiscard]] std::optional<JointVector> bump_pose(const Chain& robot, const JointVector& q,
                                                   const Sides& sides);

/// The part of [lower, upper] (rad, m) in which this joint can be approached from either side, also
/// after rounding to the grid of programs; [lower, upper] where there is none.
[[nodiscard]] std::pair<double, double> approachable_range(const Joint& joint, double lower,
                                                           double upper);

/// `q` rounded to 0.0001 deg (0.0001 mm), as programs are written: what is planned, commanded and
/// recorded is then the same number. Never outside the limits.
[[nodiscard]] JointVector on_program_grid(const Chain& robot, JointVector q);

}  // namespace trammel
