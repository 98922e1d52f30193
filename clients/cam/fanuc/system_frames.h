#pragma once

#include <vector>

#include "clients/cam/keep.h"

namespace trammel::cam::fanuc {

/// `$MNUFRAME` and `$MNUTOOL` of group 1 in system variables that were saved as text (sysframe.va),
/// by the names `UFRAME[1]`, `UTOOL[1]`. One that was never set is not there.
[[nodiscard]] ListedValues system_frames(const std::vector<SourceFile>& files);

}  // namespace trammel::cam::fanuc
