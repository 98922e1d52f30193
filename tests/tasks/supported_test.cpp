#include "server/tasks/train/supported.h"

#include <gtest/gtest.h>

#include "server/plan/plan.h"
#include "server/simulate/simulate.h"
#include "tests/support/demand.h"
#include "tests/support/small_cell.h"

namespace trammel {
namespace {

TEST(Supported, KeepsACauseOfWhichOnlyFewPosesTell) {
  const auto cell = test::small_cell("cell-1");
  const std::vector<std::string> found = {"gear_transmission:3@2", "joint_slip:2@113"};
  VirtualRobot robot{
      test::demand(make_physical_model(cell, {"base", found[0], found[1]})), 20e-6, 60e-6, {}};
  robot.truth.values.tail<3>() = Eigen::Vector3d(1e-4, 2e-4, 4e-5);
  const Eigen::MatrixXd q = test::demand(plan_poses(*cell, {120, 1}));
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    SimulateOptions options;
    options.seed = seed;
    MeasurementBatch train = test::demand(simulate(robot, q, options)), judges = train;
    std::erase_if(train.measurements, [](const Measurement& m) { return m.row % 4 == 0; });
    std::erase_if(judges.measurements, [](const Measurement& m) { return m.row % 4 != 0; });
    const Supported supported =
        test::demand(supported_by(cell, {"base"}, found, train, judges, nullptr));
    EXPECT_EQ(supported.sources, found) << "seed " << seed << ": " << to_string(supported.left_out);
  }
}

}  // namespace
}  // namespace trammel
