#pragma once

#include "server/plan/plan.h"

namespace trammel {

/// The travel time of the arm from pose to pose of a plan, each with its approach: the sum of the
/// times of its motions with every joint at its greatest speed, s. An unknown speed counts as 1
/// rad/s or 1 m/s.
[[nodiscard]] double travel_of(const Chain& robot, const Plan& plan);

/// The poses in an order with little travel. It begins as the plan does; poses of one tool and
/// payload stay together, and so do poses that are approached from both sides. Plans of more than
/// 5000 poses are unchanged.
[[nodiscard]] Plan ordered_for_travel(const Chain& robot, Plan plan);

}  // namespace trammel
