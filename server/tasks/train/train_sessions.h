#pragma once

#include <vector>

#include "server/compensate/model_parts.h"
#include "server/measurement/split.h"

/// Training from several sessions of one arm.
namespace trammel {

/// Removes the sessions from `split` whose training rows do not determine the place of their
/// instrument; returns them.
[[nodiscard]] std::vector<LeftOutSession> leave_out_unplaced(BatchSplit& split);

}  // namespace trammel
