#pragma once

#include <string>

#include "server/base/result.h"
#include "server/robot/cell.h"

namespace trammel {

/// What a certificate of a cell names, as its file has it; empty where it says nothing.
struct CellPapers {
  std::string serial_number;  ///< of the robot
  std::string instrument;     ///< that its batches are measured with
  std::string operator_name;  ///< who measures
};
/// Nothing of a cell without a file.
[[nodiscard]] Result<CellPapers> papers_of(const Cell& cell);

}  // namespace trammel
