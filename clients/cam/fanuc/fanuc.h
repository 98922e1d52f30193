#pragma once

#include <vector>

#include "clients/cam/keep.h"
#include "clients/cam/program.h"

namespace trammel::cam {

/// Reads FANUC TP programs (.ls). Positions are those of /POS, poses or joints, with their stated
/// user frame and tool. The values of UFRAME[n] and UTOOL[n] come from `UFRAME[n]=PR[m]` with a
/// constant PR[m], or from the user. The world frame counts as the robot's base.
[[nodiscard]] Program read_fanuc(std::vector<SourceFile> files, const ReadOptions& options);

namespace fanuc {

/// `$MNUFRAME` and `$MNUTOOL` of group 1 from system variables that were saved as text
/// (sysframe.va), by the names `UFRAME[1]`, `UTOOL[1]`. Those that were never set are missing.
[[nodiscard]] ListedValues system_frames(const std::vector<SourceFile>& files);

}  // namespace fanuc

}  // namespace trammel::cam
