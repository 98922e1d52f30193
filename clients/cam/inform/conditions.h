#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "clients/cam/program.h"

namespace trammel::cam::inform {

/// A tool or user frame as the controller's condition files have it.
struct Condition {
  Pose X = Pose::Identity();       ///< a tool from the flange, a user frame from the robot's base
  std::optional<StatedLoad> load;  ///< of a tool
  std::string file;
  int line = 0;
  std::string why_not;  ///< why its value is not known; empty: it is
};

/// What Yaskawa's TOOL.CND and UFRAME.CND say, by the names `TOOL[0]`, `USER[1]`. One that two
/// files have otherwise is not known; one without its six numbers is not there.
[[nodiscard]] std::map<std::string, Condition> conditions(const std::vector<SourceFile>& files);

}  // namespace trammel::cam::inform
