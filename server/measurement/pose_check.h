#pragma once

#include <string>
#include <vector>

#include "server/base/result.h"
#include "server/robot/cell.h"
#include "server/robot/pose_context.h"

namespace trammel {

/// Refuses joint columns that are not those of the robot: their number, and degrees for a rail.
[[nodiscard]] Status check_joint_columns(const std::vector<JointType>& columns, const Chain& robot,
                                         const std::string& where);

/// Holds the joints against the robot's limits and resolves tool and payload. File and row are the caller's to add.
[[nodiscard]] Status check_pose(PoseContext& context, const Cell& cell);

}  // namespace trammel
