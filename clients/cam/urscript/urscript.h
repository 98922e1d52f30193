#pragma once

#include <vector>

#include "clients/cam/program.h"

namespace trammel::cam {

/// Reads Universal Robots scripts: poses `p[...]` and joints `[...]` in motions, in variables that
/// are set once, and constant `pose_trans` of them. The tool is that of the previous `set_tcp`;
/// poses are in the robot's base.
[[nodiscard]] Program read_urscript(std::vector<SourceFile> files, const ReadOptions& options);

}  // namespace trammel::cam
