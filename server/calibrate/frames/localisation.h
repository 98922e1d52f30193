#pragma once

#include <utility>
#include <vector>

#include "server/base/result.h"
#include "server/robot/pose.h"

/// Closed forms that find where things stand, before anything is refined.
namespace trammel {

/// X_WB and X_FT from full poses, X_WT = X_WB X_BF X_FT (robot-world/hand-eye). The two rotations
/// come from the dominant singular pair of the sum of R_BF x R_WT (Kronecker), then both
/// translations from a linear system. Refuses fewer than 3 poses, and poses whose rotations do not
/// determine both.
struct BaseAndTool {
  Pose X_WB = Pose::Identity();
  Pose X_FT = Pose::Identity();
};
[[nodiscard]] Result<BaseAndTool> locate_base_and_tool(const std::vector<Pose>& X_WT,
                                                       const std::vector<Pose>& X_BF);

/// X_WB and the tool point p_FT from positions alone; the tool's rotation stays identity.
/// Alternates fit_transform() with a linear solve for the point until the step is below 1e-9 m. If
/// the flange turns about one axis only, the shift of the point along that axis is undetermined and
/// stays as small as possible. Refuses fewer than 6 poses, and a flange that does not turn.
[[nodiscard]] Result<BaseAndTool> locate_base_and_tool_point(const Eigen::Matrix3Xd& p_W,
                                                             const std::vector<Pose>& X_BF);

/// X_FT where the base is known: the mean over the poses. From positions alone only the point.
[[nodiscard]] Result<Pose> locate_tool(const std::vector<Pose>& X_WT,
                                       const std::vector<Pose>& X_WF);
[[nodiscard]] Result<Vector3> locate_tool_point(const Eigen::Matrix3Xd& p_W,
                                                const std::vector<Pose>& X_WF);

}  // namespace trammel
