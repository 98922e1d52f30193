#pragma once

#include "server/compensate/compensated_model.h"

namespace trammel {

/// m: the smallest radius about a pose that may be promised, ArmSteps::smallest().
[[nodiscard]] double smallest_step(const CompensatedModel& model, const PoseContext& context);
/// m: the smallest rms of the true error that may be stated there. That radius contains 95 % of it.
[[nodiscard]] double least_rms(const CompensatedModel& model, const PoseContext& context);

}  // namespace trammel
