#pragma once

#include <optional>

#include "server/compensate/joint_steps.h"
#include "server/robot/wrist.h"

/// Corrections near the wrist's singularity, where not every rotation can be corrected. The tool's
/// point reaches its target, and the joints stay near the controller's joints for it, on the same
/// side of the singularity. The remaining rotation grows smoothly towards the singularity, from
/// zero at the border.
namespace trammel {

/// The wrist if it is so near its singularity that correct_in_wrist() corrects; else empty.
[[nodiscard]] std::optional<WristOpening> closing_wrist(const Chain& robot, const JointVector& q);

/// From the joints `start`, where `missing_at_start` is missing.
[[nodiscard]] CorrectedJoints correct_in_wrist(const Chain& robot, const Pose& X_FT,
                                               const WristOpening& wrist, const JointVector& start,
                                               const Vector6& missing_at_start,
                                               const MissingAt& missing_at,
                                               const CorrectOptions& options);

}  // namespace trammel
