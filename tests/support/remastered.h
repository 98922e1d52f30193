#pragma once

#include <vector>

#include "tests/support/checked_robot.h"
#include "tests/support/plain_arm.h"

/// Robots whose joints lost their zeros, and what a check may say of them.
namespace trammel::test {

struct Remastered {
  std::vector<int> joints;  ///< 1-based, rising
  std::vector<double> by;   ///< rad, of each
  bool tool = false;        ///< was knocked by 1 mm as well
};
/// One of these sets of joints, each off by 0.2 to 90 mrad, in one world of four with the tool.
[[nodiscard]] Remastered draw_remastered(const std::vector<std::vector<int>>& joints,
                                         hidden::Random& random);
/// Wrist, elbow, two joints, all that a check can tell, and all six.
[[nodiscard]] const std::vector<std::vector<int>>& sets_of_six_axes();
[[nodiscard]] const std::vector<std::vector<int>>& sets_of_seven_axes();

/// The joint (1-based) has lost its zero by that much.
[[nodiscard]] hidden::Effect zero_off(const CheckedRobot& robot, int joint, double rad);
/// What changed in the robot of that world.
[[nodiscard]] std::vector<hidden::Effect> effects_of(const Remastered& world,
                                                     const CheckedRobot& robot,
                                                     hidden::Random& random);
/// The same in a check of a plain arm.
void apply(const Remastered& world, PlainCheck& check, hidden::Random& random);

/// The joints of lost zeros, 1-based.
[[nodiscard]] std::vector<int> joints_of(const std::vector<LostZero>& zeros);
/// True where all that is named has changed.
[[nodiscard]] bool is_right(const HealthCheck& check, const Remastered& truth);
/// True where something is named, and nothing beside it.
[[nodiscard]] bool is_sure(const HealthCheck& check);

}  // namespace trammel::test
