#pragma once

#include <string>
#include <vector>

#include "server/base/result.h"
#include "server/robot/cell.h"
#include "server/robot/pose_context.h"

namespace trammel {

/// Refuses joint columns that do not match the robot: another number, or degrees for a rail.
[[nodiscard]] Status check_joint_columns(const std::vector<JointType>& columns, const Chain& robot,
                                         const std::string& where);

/// Inserts 0 for each passive joint (passive_joint.h) into the columns and the poses, if the file
/// only has columns of the driven joints, in their order.
void put_in_passive_joints(const Chain& robot, std::vector<JointType>& columns,
                           const std::vector<PoseContext*>& poses);

/// Checks the joint limits and resolves tool and payload. The caller adds file and row to the
/// error.
[[nodiscard]] Status check_pose(PoseContext& context, const Cell& cell);

}  // namespace trammel
