#pragma once

#include <optional>

#include "server/robot/chain.h"

/// Closed-form inverse kinematics of arms as Universal Robots builds them: axes 2, 3 and 4 are
/// parallel, and the wrist axes do not meet.
namespace trammel {

[[nodiscard]] bool has_offset_wrist(const Chain& chain);

/// One of the eight branches of `X_BF`, for an arm with such a wrist. `branch` is 0..7: its bits 4,
/// 2 and 1 choose between the two solutions of joints 1, 3 and 5. Joints turn to the values nearest
/// to `near` that the limits allow; limits are not checked beyond that. If axes 4 and 6 are
/// parallel, joint 6 stays near `near`. Empty: out of reach.
[[nodiscard]] std::optional<JointVector> joints_of_offset_wrist(const Chain& chain,
                                                                const Pose& X_BF, int branch,
                                                                const JointVector& near);

}  // namespace trammel
