#pragma once

#include <vector>

#include "tests/support/checked_robot.h"
#include "tests/support/plain_arm.h"

/// Robots whose joints lost their zeros, and the acceptable results of a check.
namespace trammel::test {

struct Remastered {
  std::vector<int> joints;  ///< 1-based, rising
  std::vector<double> by;   ///< rad, of each
  bool tool = false;        ///< was knocked by 1 mm as well
};
/// Draws one of these sets of joints, each off by 0.2 to 90 mrad; in one world of four the tool is
/// off as well.
[[nodiscard]] Remastered draw_remastered(const std::vector<std::vector<int>>& joints,
                                         hidden::Random& random);
/// Sets of joints: wrist, elbow, two joints, all that a check can tell, and all six.
[[nodiscard]] const std::vector<std::vector<int>>& sets_of_six_axes();
[[nodiscard]] const std::vector<std::vector<int>>& sets_of_seven_axes();

/// The loss of a joint's zero (1-based) by that much.
[[nodiscard]] hidden::Effect zero_off(const CheckedRobot& robot, int joint, double rad);
/// The changes of the robot in that world.
[[nodiscard]] std::vector<hidden::Effect> effects_of(const Remastered& world,
                                                     const CheckedRobot& robot,
                                                     hidden::Random& random);
/// The same in a check of a plain arm.
void apply(const Remastered& world, PlainCheck& check, hidden::Random& random);

/// The joints of lost zeros, 1-based.
[[nodiscard]] std::vector<int> joints_of(const std::vector<LostZero>& zeros);
/// True where all that is named has changed.
[[nodiscard]] bool is_right(const HealthCheck& check, const Remastered& truth);
/// True if the check names a change without alternatives.
[[nodiscard]] bool is_sure(const HealthCheck& check);

}  // namespace trammel::test
