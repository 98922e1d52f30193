#pragma once

#include <optional>
#include <utility>

#include "server/robot/chain.h"

/// How a measuring pose is approached, so that play in the gears is always taken up from the same side.
namespace trammel {

/// The pose from which `q` (rad, m) is approached slowly with every gear turning in `direction` (+1 or -1): the "bump"
/// of source section 3.2.4.2, q - direction * 5 deg (50 mm of a rail) where the controller counts the gears, kept
/// within the limits. Nothing where a limit leaves a gear less than 1 deg (10 mm) to move: too little to take up the
/// play.
[[nodiscard]] std::optional<JointVector> bump_pose(const Chain& robot, const JointVector& q, int direction);

/// The part of [lower, upper] (rad, m) in which this joint can be approached from either side, also after rounding to
/// the grid of programs; [lower, upper] where there is none.
[[nodiscard]] std::pair<double, double> approachable_range(const Joint& joint, double lower, double upper);

/// `q` rounded to 0.0001 deg (0.0001 mm), as programs are written: what is planned, commanded and recorded is then the
/// same number. Never outside the limits.
[[nodiscard]] JointVector on_program_grid(const Chain& robot, JointVector q);

}  // namespace trammel
