#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "server/robot/pose.h"

namespace trammel {

/// Time constants, s, of bodies that follow the temperature (first order): 2 minutes to 4 hours.
inline constexpr std::array<double, 13> kHeatLags = {120,  180,  270,  405,  608,   911,  1367,
                                                     2050, 3075, 4613, 6920, 10380, 15570};

/// Everything recorded with one pose that may influence the tool pose.
struct PoseContext {
  JointVector q;                        ///< as commanded, rad (m for a prismatic joint), size n
  std::optional<double> time;           ///< s
  std::optional<double> temperature;    ///< degrees Celsius
  std::optional<JointVector> velocity;  ///< rad/s (m/s), size n; from neighbouring poses in time
  std::vector<int>
      direction;  ///< approach side of each joint's gear, -1, 0, +1; empty: not recorded
  std::optional<JointVector>
      before;  ///< the previous joint vector, size n; empty where it is unknown
  std::vector<double>
      lagged;  ///< degrees Celsius, as bodies feel it that follow by kHeatLags; empty: unknown
  std::string tool;     ///< id in the cell file
  std::string payload;  ///< id in the cell file
  int index = 0;        ///< position in its batch, for effects that begin at a pose
  bool served = false;  ///< true for a request: it is later than every pose of the batch and has no
                        ///< tracker

  /// True from the pose with index `first` on, and for every served pose.
  [[nodiscard]] bool from(int first) const { return served || index >= first; }
};

}  // namespace trammel
