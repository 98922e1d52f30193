#pragma once

#include <vector>

#include "tests/support/checked_robot.h"

/// Robots whose joints lost their zeros, and what a check may say of them.
namespace trammel::test {

struct Remastered {
  std::vector<int> joints;  ///< 1-based, rising
  bool tool = false;        ///< was knocked as well
  std::vector<hidden::Effect> effects;
};
/// The joint (1-based) has lost its zero by that much.
[[nodiscard]] hidden::Effect zero_off(const CheckedRobot& robot, int joint, double rad);
/// Two to five zeros of 0.06 to 90 mrad, in one world of four with a tool that is off by 1 mm.
[[nodiscard]] Remastered draw_remastered(const CheckedRobot& robot, hidden::Random& random);

/// The joints of lost zeros, 1-based.
[[nodiscard]] std::vector<int> joints_of(const std::vector<LostZero>& zeros);
/// True where all that is named has changed.
[[nodiscard]] bool is_right(const HealthCheck& check, const Remastered& truth);
/// True where something is named, and nothing beside it.
[[nodiscard]] bool is_sure(const HealthCheck& check);

}  // namespace trammel::test
