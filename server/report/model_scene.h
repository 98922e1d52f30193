#pragma once

#include <nlohmann/json.hpp>

#include "server/report/model_poses.h"

namespace trammel {

/// The scene that the model's page draws in space, mm in B. `arm`: each pose by its corners from
/// the base to the tool. `before`, `after`: its error. `shell`: rings about the first axis at the
/// outermost tool places in the domain. `box`: the corners that the tool was measured between.
/// `promised`: the corners of the shell (`lower`, `upper`), its largest `radius_mm` and the
/// `volume_m3` that it encloses. Without `shown` poses it shows poses of the domain, with
/// the model's correction as `before` and an unknown `after`. Null if the model knows no pose at
/// all.
[[nodiscard]] nlohmann::ordered_json scene_json(const CompensatedModel& model,
                                                const ShownPoses& shown);

}  // namespace trammel
