#pragma once

#include "server/compensate/compensated_model.h"

namespace trammel {

/// m: no smaller radius about a pose is promised, ArmSteps::smallest().
[[nodiscard]] double smallest_step(const CompensatedModel& model, const PoseContext& context);
/// m: the least rms that may be told of the true error there, whose 95 % are that radius.
[[nodiscard]] double least_rms(const CompensatedModel& model, const PoseContext& context);

}  // namespace trammel
