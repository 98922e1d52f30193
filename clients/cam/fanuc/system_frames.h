#pragma once

#include <map>
#include <string>
#include <vector>

#include "clients/cam/program.h"

namespace trammel::cam::fanuc {

/// A frame or tool as the controller's system variables have it.
struct SystemFrame {
  Pose X = Pose::Identity();
  std::string file;
  int line = 0;
  std::string why_not;  ///< why its value is not known; empty: it is
};

/// `$MNUFRAME` and `$MNUTOOL` of group 1 in system variables that were saved as text (sysframe.va),
/// by the names `UFRAME[1]`, `UTOOL[1]`. One that was never set is not there; one that two files
/// have otherwise is not known.
[[nodiscard]] std::map<std::string, SystemFrame> system_frames(
    const std::vector<SourceFile>& files);

}  // namespace trammel::cam::fanuc
