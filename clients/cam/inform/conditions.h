#pragma once

#include <vector>

#include "clients/cam/keep.h"

namespace trammel::cam::inform {

/// What Yaskawa's TOOL.CND and UFRAME.CND say, by the names `TOOL[0]`, `USER[1]`: a tool
/// from the flange, a user frame from the robot's base. One without its six numbers is not there.
[[nodiscard]] ListedValues conditions(const std::vector<SourceFile>& files);

}  // namespace trammel::cam::inform
