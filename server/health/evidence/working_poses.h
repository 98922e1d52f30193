#pragma once

#include "server/compensate/compensated_model.h"

namespace trammel::health {

/// Poses like those of the robot's work: over the ranges of the model's training poses, inside the
/// cell's workspace, with tool, payload and temperature of `like`, and random directions of
/// approach.
[[nodiscard]] std::vector<PoseContext> working_poses(const CompensatedModel& model,
                                                     const PoseContext& like, std::uint64_t seed);

}  // namespace trammel::health
