#pragma once

#include <vector>

#include "server/robot/pose.h"

namespace trammel {

/// The 24 rotations that take a cube onto itself, the identity first. Every rotation is within 63
/// degrees of one of them, so they are starts for a search over all rotations.
[[nodiscard]] const std::vector<Matrix3>& cube_turns();

/// X_AB turned in A by `turn` about the point `p_A`, which stays where it is.
[[nodiscard]] Pose turned_about(const Vector3& p_A, const Matrix3& turn, const Pose& X_AB);

}  // namespace trammel
