#pragma once

#include <vector>

#include "server/compensate/model_parts.h"
#include "server/measurement/split.h"

/// Training from several sessions of one arm.
namespace trammel {

/// Takes the sessions out of `split` whose training rows do not tell where their instrument stood;
/// returns them.
[[nodiscard]] std::vector<LeftOutSession> leave_out_unplaced(BatchSplit& split);

}  // namespace trammel
