#pragma once

#include <vector>

#include "server/base/units.h"
#include "server/compensate/compensated_model.h"
#include "server/robot/lead_in.h"

namespace trammel {

/// The move that a request is taken to end with where it says its side of approach, rad (m): the
/// shortest way by which a measuring pose is come to. Hysteresis depends on it, play does not.
constexpr double kSaidMove = from_deg(1);

/// Joints of which the model knows that the side of approach decides where they stand, each with
/// the way that takes this up: five times the play itself (2 b, the largest in the model's range),
/// at least 0.1 deg; of hysteresis kSaidMove. The side is the one from which more training poses
/// came.
[[nodiscard]] std::vector<TakeUp> take_ups(const CompensatedModel& model);

}  // namespace trammel
