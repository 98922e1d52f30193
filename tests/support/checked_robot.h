#pragma once

#include <string>
#include <vector>

#include "server/compensate/compensated_model.h"
#include "server/health/health_check.h"
#include "tests/support/hidden_check.h"

/// A hidden robot, the model trained on its files alone, and the poses planned for its checks.
namespace trammel::test {

struct CheckedRobot {
  hidden::TrainedRobot robot;
  CompensatedModel model;
  std::vector<hidden::Joints> planned;
};
/// `poses`: of the check.
[[nodiscard]] CheckedRobot trained_robot(const hidden::RobotSpec& spec, int poses = 12,
                                         const std::string& bias = "none");

struct Hidden {
  std::vector<hidden::Effect> effects = {};
  int bad_pose = -1;
  double bad_mm = 0;
};
/// The rows that such a check measures.
[[nodiscard]] MeasurementBatch measured_check(const CheckedRobot& robot, const Hidden& hidden,
                                              std::uint64_t seed);
/// The result of a check of the planned poses with the robot in its present state.
[[nodiscard]] HealthCheck checked(const CheckedRobot& robot, const Hidden& hidden,
                                  std::uint64_t seed, const HealthOptions& options);

}  // namespace trammel::test
