#pragma once

#include <optional>
#include <string>

#include "server/base/result.h"
#include "server/robot/cell.h"

namespace trammel {

/// The record, under `robot_confirmed` in the cell file, that the robot file was compared with the
/// controller.
struct RobotConfirmation {
  std::string robot_sha256;    ///< of the compared robot file; another text is another robot
  int poses = 0;               ///< the number of poses that the controller showed
  double position_mm = 0;      ///< the largest difference
  double orientation_deg = 0;  ///< the largest difference
  std::string day;             ///< 2026-11-26
};

/// The confirmation in the cell file. Empty if the file has none, or if the robot file has changed
/// since.
[[nodiscard]] std::optional<RobotConfirmation> confirmation_of(const Cell& cell);

/// The text of a cell file with the line `robot_confirmed` as it is now, or without one. Refuses a
/// file to which a line cannot be added.
[[nodiscard]] Result<std::string> with_confirmation(
    const Cell& cell, const std::optional<RobotConfirmation>& confirmation);

}  // namespace trammel
