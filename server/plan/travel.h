#pragma once

#include "server/plan/plan.h"

namespace trammel {

/// The travel of the arm from pose to pose of a plan, each by way of its approach: the sum of the
/// times of its motions where every joint moves at its greatest speed, s; at 1 rad/s and 1 m/s
/// where a speed is not known.
[[nodiscard]] double travel_of(const Chain& robot, const Plan& plan);

/// The poses in an order in which the arm travels little: it begins as the plan does, poses of
/// one tool and payload stay together, and so do those that are approached from both sides. Plans
/// of more than 5000 poses stay.
[[nodiscard]] Plan ordered_for_travel(const Chain& robot, Plan plan);

}  // namespace trammel
