#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tests/support/hidden_files.h"
#include "tests/support/hidden_world.h"

/// A robot of the second simulation that is trained once and then checked by a few poses, changed
/// or not. The check gets the files and nothing more.
namespace trammel::hidden {

struct RobotSpec {
  std::uint64_t seed = 1;
  int poses = 200;  ///< of the training
  bool orientation = true;
  double sigma_mm = 0.013;
  double tail_freedom = 0;  ///< of Student's t, of equal variance, for the noise; 0: normal
  double ripple_mm =
      0;  ///< rms of a smooth error of the arm that no cause makes and that never changes
  std::vector<std::string> sources = {"base", "geometry", "compliance"};
};

struct TrainedRobot {
  RobotSpec spec;
  World world;  ///< the real world, at the poses of the training
  Belief belief;
  std::string cell_yaml, robot_yaml, batch_csv;
};
[[nodiscard]] TrainedRobot draw_robot(const RobotSpec& spec);
/// The same robot with this arm, and nothing else changed.
[[nodiscard]] TrainedRobot robot_with(const RobotSpec& spec, const Arm& arm);

/// `cause` with random numbers, acting from the first pose on. It is scaled to `rms_mm`: the rms
/// position over poses of the whole ranges, after refitting base and, with `new_tool`, the tool.
[[nodiscard]] Effect changed_by(const TrainedRobot& robot, const HiddenCause& cause, double rms_mm,
                                bool new_tool, Random& random);
/// mm: that size, of any effects.
[[nodiscard]] double left_rms_mm(const TrainedRobot& robot, const std::vector<Effect>& effects,
                                 bool new_tool);

/// The batch of a check at these joints (rad), measured by a tracker that stands elsewhere.
/// `bad_pose`: the row that is off by `bad_mm` in a random direction; -1: none.
struct CheckSpec {
  std::vector<Joints> q;
  std::vector<Effect> effects;
  int bad_pose = -1;
  double bad_mm = 0;
};
[[nodiscard]] std::string check_csv(const TrainedRobot& robot, const CheckSpec& check,
                                    Random& random);

}  // namespace trammel::hidden
