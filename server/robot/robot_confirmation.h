#pragma once

#include <optional>
#include <string>

#include "server/base/result.h"
#include "server/robot/cell.h"

namespace trammel {

/// That the robot file of a cell was compared with its controller, as the cell file says it under
/// `robot_confirmed`.
struct RobotConfirmation {
  std::string robot_sha256;  ///< of the robot file that was compared; another text is another robot
  int poses = 0;             ///< that the controller showed
  double position_mm = 0;    ///< the largest difference
  double orientation_deg = 0;  ///< the largest difference
  std::string day;             ///< 2026-11-26
};

/// The confirmation in the cell file; empty where it says nothing, or where the robot file changed
/// since.
[[nodiscard]] std::optional<RobotConfirmation> confirmation_of(const Cell& cell);

/// The text of a cell file with the line `robot_confirmed` as it is now, or without one. Refuses a
/// file to which a line cannot be added.
[[nodiscard]] Result<std::string> with_confirmation(
    const Cell& cell, const std::optional<RobotConfirmation>& confirmation);

}  // namespace trammel
