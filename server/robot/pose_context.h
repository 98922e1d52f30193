#pragma once

#include <optional>
#include <string>
#include <vector>

#include "server/robot/pose.h"

namespace trammel {

/// Everything known about the moment of one pose that may matter to where the tool is.
struct PoseContext {
  JointVector q;                        ///< as commanded, rad (m for a prismatic joint), size n
  std::optional<double> time;           ///< s
  std::optional<double> temperature;    ///< degrees Celsius
  std::optional<JointVector> velocity;  ///< rad/s (m/s), size n; from neighbouring poses in time
  std::vector<int> direction;           ///< approach direction of each joint, -1, 0, +1; empty when not recorded
  std::string tool;                     ///< id in the cell file
  std::string payload;                  ///< id in the cell file
  int index = 0;                        ///< position in its batch, for effects that begin at a pose
  bool served = false;  ///< asked for, not measured: after every pose of the batch, and without its tracker

  /// True from the pose with this index on, and in everything that is served.
  [[nodiscard]] bool from(int first) const { return served || index >= first; }
};

}  // namespace trammel
