#include "tests/support/remastered.h"

#include <algorithm>
#include <cmath>

namespace trammel::test {

hidden::Effect zero_off(const CheckedRobot& robot, int joint, double rad) {
  hidden::Random random(5);
  hidden::Effect effect = changed_by(robot.robot, {"joint_slip", joint, "", 0, {}, 0}, 0.1, false, random);
  effect.values(0) = rad;
  return effect;
}

Remastered draw_remastered(const CheckedRobot& robot, hidden::Random& random) {
  static const std::vector<std::vector<int>> kJoints = {{2, 3, 4, 5},    {4, 5, 6}, {2, 3},
                                                        {2, 3, 4, 5, 6}, {3, 5},    {3, 4}};
  std::uniform_real_distribution<double> logarithm(std::log(2e-4), std::log(9e-2)), share(0.3, 1.0);
  Remastered world;
  world.joints = kJoints[random() % kJoints.size()];
  world.tool = random() % 4 == 0;
  const double largest = std::exp(logarithm(random));
  for (const int joint : world.joints)
    world.effects.push_back(zero_off(robot, joint, (random() % 2 == 0 ? 1 : -1) * share(random) * largest));
  if (world.tool)
    world.effects.push_back(changed_by(robot.robot, {"tool_changed", 0, "", 0, {}, 0}, 1.0, false, random));
  return world;
}

std::vector<int> joints_of(const std::vector<LostZero>& zeros) {
  std::vector<int> joints;
  for (const LostZero& zero : zeros) joints.push_back(zero.joint + 1);
  return joints;
}

bool is_right(const HealthCheck& check, const Remastered& truth) {
  return !check.changed.empty() &&
         std::all_of(check.changed.begin(), check.changed.end(), [&](const SeenChange& change) {
           const std::vector<int> joints = joints_of(change.zeros);
           if (joints.empty()) return truth.tool && change.cause.record->spelling == "tool_changed";
           return std::includes(truth.joints.begin(), truth.joints.end(), joints.begin(), joints.end());
         });
}

bool is_sure(const HealthCheck& check) {
  return !check.changed.empty() &&
         std::all_of(check.changed.begin(), check.changed.end(), [](const SeenChange& change) {
           return change.could_also_be.empty() && change.cause.record->stands_for == causes::StandsFor::kACause;
         });
}

}  // namespace trammel::test
