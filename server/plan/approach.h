#pragma once

#include <optional>
#include <utility>

#include "server/robot/chain.h"

/// How a measuring pose is approached, so that play in the gears is taken up the same way every time.
namespace trammel {

/// The pose from which `q` (rad, m) is approached slowly with every joint moving in `direction` (+1 or -1): the "bump"
/// of source section 3.2.4.2, q - direction * 5 deg (50 mm of a rail), held within the limits. Nothing where a limit
/// leaves a joint less than 1 deg (10 mm) of way: too little to be sure of the side.
[[nodiscard]] std::optional<JointVector> bump_pose(const Chain& robot, const JointVector& q, int direction);

/// The part of [lower, upper] (rad, m) in which this joint can be approached from either side, and which rounding to
/// the grid of programs does not leave; [lower, upper] where there is none.
[[nodiscard]] std::pair<double, double> approachable_range(const Joint& joint, double lower, double upper);

/// `q` on the grid of 0.0001 deg (0.0001 mm) that programs are written in, so that what is planned, commanded and
/// recorded is one number; never outside the limits.
[[nodiscard]] JointVector on_program_grid(const Chain& robot, JointVector q);

}  // namespace trammel
