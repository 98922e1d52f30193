#include "tests/support/remastered.h"

#include <algorithm>
#include <cmath>

#include "server/base/units.h"

namespace trammel::test {

Remastered draw_remastered(const std::vector<std::vector<int>>& joints, hidden::Random& random) {
  constexpr double kLeast = 2e-4, kMost = 9e-2;  // rad
  std::uniform_real_distribution<double> logarithm(std::log(kLeast), std::log(kMost)),
      share(0.3, 1.0);
  Remastered world;
  world.joints = joints[random() % joints.size()];
  world.tool = random() % 4 == 0;
  const double largest = std::exp(logarithm(random));
  for (std::size_t k = 0; k < world.joints.size(); ++k)
    world.by.push_back((random() % 2 == 0 ? 1 : -1) * std::max(kLeast, share(random) * largest));
  return world;
}

const std::vector<std::vector<int>>& sets_of_six_axes() {
  static const std::vector<std::vector<int>> all = {
      {2, 3, 4, 5}, {4, 5, 6}, {2, 3}, {2, 3, 4, 5, 6}, {3, 5}, {3, 4}, {1, 2, 3, 4, 5, 6}};
  return all;
}

const std::vector<std::vector<int>>& sets_of_seven_axes() {
  static const std::vector<std::vector<int>> all = {{5, 6, 7}, {3, 4},          {2, 4},
                                                    {4, 6},    {2, 3, 4, 5, 6}, {2, 3, 4, 5, 6, 7}};
  return all;
}

hidden::Effect zero_off(const CheckedRobot& robot, int joint, double rad) {
  hidden::Random random(5);
  hidden::Effect effect =
      changed_by(robot.robot, {"joint_slip", joint, "", 0, {}, 0}, 0.1, false, random);
  effect.values(0) = rad;
  return effect;
}

std::vector<hidden::Effect> effects_of(const Remastered& world, const CheckedRobot& robot,
                                       hidden::Random& random) {
  std::vector<hidden::Effect> effects;
  for (std::size_t k = 0; k < world.joints.size(); ++k)
    effects.push_back(zero_off(robot, world.joints[k], world.by[k]));
  if (world.tool)
    effects.push_back(
        changed_by(robot.robot, {"tool_changed", 0, "", 0, {}, 0}, 1.0, false, random));
  return effects;
}

void apply(const Remastered& world, PlainCheck& check, hidden::Random& random) {
  for (std::size_t k = 0; k < world.joints.size(); ++k)
    check.zeros(world.joints[k] - 1) += world.by[k];
  const Vector3 knocked(hidden::normal(random), hidden::normal(random), hidden::normal(random));
  if (world.tool) check.tool += from_mm(1) * knocked.normalized();
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
           return std::includes(truth.joints.begin(), truth.joints.end(), joints.begin(),
                                joints.end());
         });
}

bool is_sure(const HealthCheck& check) {
  return !check.changed.empty() &&
         std::all_of(check.changed.begin(), check.changed.end(), [](const SeenChange& change) {
           return change.could_also_be.empty() &&
                  change.cause.record->stands_for == causes::StandsFor::kACause;
         });
}

}  // namespace trammel::test
