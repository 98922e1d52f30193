#pragma once

#include <vector>

#include "server/base/result.h"
#include "server/robot/cell.h"

/// Reads how a controller that commands in pulses counts the joints of a robot.
namespace trammel {

/// Pulses of the controller for one degree of the commanded value of each joint, with sign, as the
/// robot file states them (`pulses_per_deg` of its joints). Empty if the file does not, and for a
/// cell without a robot file.
[[nodiscard]] Result<std::vector<double>> joint_pulses(const Cell& cell);

}  // namespace trammel
