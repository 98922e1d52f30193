#pragma once

#include <optional>
#include <string>
#include <vector>

#include "server/robot/pose.h"

namespace trammel {

/// Everything recorded with one pose that may influence the tool pose.
struct PoseContext {
  JointVector q;                        ///< as commanded, rad (m for a prismatic joint), size n
  std::optional<double> time;           ///< s
  std::optional<double> temperature;    ///< degrees Celsius
  std::optional<JointVector> velocity;  ///< rad/s (m/s), size n; from neighbouring poses in time
  std::vector<int> direction;           ///< approach direction of each joint, -1, 0, +1; empty when not recorded
  std::string tool;                     ///< id in the cell file
  std::string payload;                  ///< id in the cell file
  int index = 0;                        ///< position in its batch, for effects that begin at a pose
  bool served = false;  ///< of a request, not measured: later than every pose of the batch, and without its tracker

  /// True from the pose with index `first` on, and for every served pose.
  [[nodiscard]] bool from(int first) const { return served || index >= first; }
};

}  // namespace trammel
