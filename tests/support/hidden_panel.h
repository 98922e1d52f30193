#pragma once

#include <vector>

#include "tests/support/hidden_world.h"

namespace trammel::hidden {

/// The drilling panel of the source's chapter 7: 35 holes, 5 across 0.5 m by 7 up 1.2 m, on an
/// upright plane in front of the robot, the spindle square to it. Joints are those for the arm of
/// `world` without its errors.
[[nodiscard]] std::vector<MeasuringPose> panel_poses(const World& world, Random& random);

}  // namespace trammel::hidden
