#pragma once

#include <string>

#include "server/base/result.h"
#include "server/robot/cell.h"

namespace trammel {

/// The fields of a cell's certificate, from its file; missing ones are empty.
struct CellPapers {
  std::string serial_number;           ///< of the robot
  std::string instrument;              ///< the instrument of its batches
  std::string instrument_certificate;  ///< the number of the instrument's own calibration
  std::string operator_name;           ///< who measures
};
/// Empty for a cell without a file.
[[nodiscard]] Result<CellPapers> papers_of(const Cell& cell);

}  // namespace trammel
