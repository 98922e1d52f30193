#pragma once

#include <vector>

#include "tests/support/hidden_world.h"

namespace trammel::hidden {

/// The drilling panel of the source's chapter 7: 35 holes, 5 across 0.5 m by 7 up 1.2 m, on an
/// upright plane in front of the robot, the spindle square to it. Joints as the arm of `world`
/// without its errors would be told.
[[nodiscard]] std::vector<MeasuringPose> panel_poses(const World& world, Random& random);

}  // namespace trammel::hidden
