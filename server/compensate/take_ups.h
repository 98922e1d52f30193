#pragma once

#include <vector>

#include "server/base/units.h"
#include "server/compensate/compensated_model.h"
#include "server/robot/lead_in.h"

namespace trammel {

/// The last move, rad (m), that is assumed if a request states its side of approach: the shortest
/// approach to a measuring pose. Hysteresis depends on it, play does not.
constexpr double kSaidMove = from_deg(1);

/// The joints whose position depends on the side of approach, as far as the model knows, each with
/// the way that takes this up. For play the way is five times the play (2 b, the largest in the
/// model's range), at least 0.1 deg; for hysteresis it is kSaidMove. The side is the one from which
/// more training poses came.
[[nodiscard]] std::vector<TakeUp> take_ups(const CompensatedModel& model);

}  // namespace trammel
