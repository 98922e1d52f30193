#pragma once

#include <array>
#include <optional>

#include "server/robot/chain.h"

namespace trammel {

/// The commanded joints of a six-axis arm whose links stand at `theta` (rad): each turned to the
/// value nearest to `near` (zero when absent) that its limits allow; where they allow none, the
/// nearest of all.
[[nodiscard]] JointVector joints_of_angles(const Chain& chain, const std::array<double, 6>& theta,
                                           const std::optional<JointVector>& near);

}  // namespace trammel
