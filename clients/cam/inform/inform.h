#pragma once

#include <vector>

#include "clients/cam/keep.h"
#include "clients/cam/program.h"

namespace trammel::cam {

/// Reads Yaskawa INFORM jobs (.jbi): rectangular positions C00000 and on, with tool, user frame and
/// RCONF, and joints in pulses, if the options tell how many make a degree. The values of TOOL[n]
/// and USER[n] come from the user; frame BASE or ROBOT is the robot's base.
[[nodiscard]] Program read_inform(std::vector<SourceFile> files, const ReadOptions& options);

namespace inform {

/// The values of Yaskawa's TOOL.CND and UFRAME.CND, by the names `TOOL[0]`, `USER[1]`: a tool from
/// the flange, a user frame from the robot's base. An entry without its six numbers is left out.
[[nodiscard]] ListedValues conditions(const std::vector<SourceFile>& files);

}  // namespace inform

}  // namespace trammel::cam
