#pragma once

#include "server/compensate/compensated_model.h"

namespace trammel::health {

/// Poses as the robot works at: over the ranges of the model's training poses, inside the cell's
/// workspace, with tool, payload and temperature of `like`, the directions of approach as they
/// come.
[[nodiscard]] std::vector<PoseContext> working_poses(const CompensatedModel& model,
                                                     const PoseContext& like, std::uint64_t seed);

}  // namespace trammel::health
