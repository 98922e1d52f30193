#pragma once

#include "server/robot/chain.h"

namespace trammel {

/// A joint that nobody commands, since bars hold it (`passive: true`): its commanded value is 0
/// everywhere, and only its coupling moves it.
[[nodiscard]] inline bool is_passive(const Joint& joint) { return joint.lower == joint.upper; }

}  // namespace trammel
