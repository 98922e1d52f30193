#pragma once

#include <optional>

#include "server/robot/chain.h"
#include "server/robot/pose.h"

namespace trammel {

/// The joints near `q` (rad) at which the point `p_F` of the flange (m) of the drawn robot is at
/// `p_B` (m): steps of least length from `q`. Empty if they end elsewhere, or beyond a joint limit.
[[nodiscard]] std::optional<JointVector> contact_posture(const Chain& robot, const Vector3& p_F,
                                                         const Vector3& p_B, JointVector q);

}  // namespace trammel
