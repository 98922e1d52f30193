#pragma once

#include <optional>
#include <vector>

#include "server/robot/chain.h"

namespace trammel {

/// A straight part of the arm as its lines of the robot file have it, from corner to corner, in B.
struct ArmPart {
  Vector3 from_B, to_B;  ///< m
  int link = 0;          ///< the joint, from 0, that carries it; the number of joints: the tool
};

/// The nominal arm at the commanded `q`: along the axis, then along the link of each joint, then to
/// the tool. Parts without a length are left out. `tool_F`: the tool's place, m; empty: none.
[[nodiscard]] std::vector<ArmPart> arm_parts(const Chain& robot, const JointVector& q,
                                             const std::optional<Vector3>& tool_F);

}  // namespace trammel
