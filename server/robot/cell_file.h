#pragma once

#include <string>

#include "server/base/result.h"
#include "server/base/yaml_file.h"
#include "server/robot/pose.h"

namespace trammel {

/// {xyz_mm: [...], q_wxyz: [...]} as cell and truth files write a pose; the quaternion may be left
/// out (no rotation).
[[nodiscard]] Pose read_pose(const YamlMap& map);

/// The path of the robot file that a cell file names.
[[nodiscard]] Result<std::string> robot_path_of(const std::string& path);

}  // namespace trammel
