#pragma once

#include <optional>
#include <string>
#include <vector>

#include "server/base/result.h"
#include "server/robot/cell.h"

namespace trammel {

/// The demands of a cell's owner, beside its description.
struct CellRules {
  std::optional<double> tolerance;  ///< m: the required accuracy of the cell, for 95 % of its
                                    ///< positions
  bool fleet_prior =
      false;  ///< false: no prior is taken from robots of this type that were trained before
  bool controller_compensates =
      false;  ///< the controller corrects errors of its own; batches were measured so
  /// External axes that carry neither the robot nor the part, by their names in robot programs.
  std::vector<std::string> idle_axes = {};
};
/// The rules in the cell file; a cell without a file has none.
[[nodiscard]] Result<CellRules> rules_of(const Cell& cell);

}  // namespace trammel
