#pragma once

#include "server/base/units.h"
#include "server/robot/chain.h"

/// Tools that may stand at any angle about their axis (drill, mill, dot). The angle is a choice.
namespace trammel {

/// rad: the step of the tried turns about the tool's axis, up to half a turn in either sense.
constexpr double kFreeTurn = from_deg(15);
constexpr int kFreeTurns = 12;  // either way

/// Turned by so many steps about its own z.
[[nodiscard]] Pose turned_freely(const Pose& X_BT, int steps);
/// True if the joints are so far from their limits (5 deg, 50 mm of a rail) and from a singular
/// wrist (10 deg) that a correction has room.
[[nodiscard]] bool stands_clear(const Chain& robot, const JointVector& q);

}  // namespace trammel
