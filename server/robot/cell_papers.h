#pragma once

#include <string>

#include "server/base/result.h"
#include "server/robot/cell.h"

namespace trammel {

/// The fields of a cell's certificate, as its file has them; empty where it says nothing.
struct CellPapers {
  std::string serial_number;  ///< of the robot
  std::string instrument;     ///< that its batches are measured with
  std::string operator_name;  ///< who measures
};
/// Nothing of a cell without a file.
[[nodiscard]] Result<CellPapers> papers_of(const Cell& cell);

}  // namespace trammel
