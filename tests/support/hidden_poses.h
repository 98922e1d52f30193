#pragma once

#include <array>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "tests/support/hidden_robot.h"

namespace trammel::hidden {

using Random = std::mt19937_64;

[[nodiscard]] double uniform(Random& random, double from, double to);
[[nodiscard]] double normal(Random& random);
/// From `from` to `to`, both included.
[[nodiscard]] int whole(Random& random, int from, int to);

/// One moment of a measurement, with all quantities that affect the tool's place.
struct MeasuringPose {
  int index = 0;
  Joints q = Joints::Zero();
  Joints velocity = Joints::Zero();  ///< rad/s
  double time_s = 0;
  double temperature_c = 20;       ///< by the thermometer
  double link_temperature_c = 20;  ///< of the links, which follow
  std::array<int, kJoints> direction = {};
  int tool = 0;
  int load = 0;
  bool validation = false;
};

enum class Course { kScattered, kPath };
enum class Approach { kAsItComes, kBothSides, kFromBelow };

struct PosePlan {
  int count = 300;
  std::string ranges = "calibration";  ///< or 1dim, 3dim, 6dim-s, 6dim-l, 6dim-m
  Course course = Course::kScattered;
  Approach approach = Approach::kAsItComes;
  bool constant_temperature = false;
  int tools = 1;  ///< used in turns of some poses
  int loads = 1;
  double validation_share = 0;
};

/// Lower and upper limit of each joint, rad. Aborts on a name it does not know.
[[nodiscard]] std::array<std::pair<double, double>, kJoints> joint_ranges(const std::string& name);
[[nodiscard]] std::vector<MeasuringPose> draw_poses(const PosePlan& plan, Random& random);

}  // namespace trammel::hidden
