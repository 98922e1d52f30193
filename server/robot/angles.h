#pragma once

#include <array>
#include <optional>

#include "server/robot/chain.h"

namespace trammel {

/// The commanded joints of a six-axis arm whose links stand at `theta` (rad). Each joint takes the
/// turn nearest to `near` (zero when absent) among those that its limits allow. If the limits allow
/// none, it takes the nearest of all turns.
[[nodiscard]] JointVector joints_of_angles(const Chain& chain, const std::array<double, 6>& theta,
                                           const std::optional<JointVector>& near);

}  // namespace trammel
