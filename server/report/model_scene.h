#pragma once

#include <nlohmann/json.hpp>

#include "server/report/model_poses.h"

namespace trammel {

/// The scene that the model's page draws in space, mm in B: `arm` of each pose as its corners from
/// the base to the tool; `before`, `after`: its error; `shell`: rings about the first axis, where
/// the tool is farthest out in the domain. Without `shown` poses: poses of the domain, before =
/// what the model corrects, after = none that is known. Null where the model knows no pose at all.
[[nodiscard]] nlohmann::ordered_json scene_json(const CompensatedModel& model,
                                                const ShownPoses& shown);

}  // namespace trammel
