#include "server/tasks/train/bias_spread.h"

#include <gtest/gtest.h>

#include "server/tasks/train/train.h"
#include "tests/support/demand.h"
#include "tests/support/virtual_robot.h"

namespace trammel {
namespace {

/// The shipped robot, of which M1 leaves link geometry and compliances to the bias.
CompensatedModel trained(const VirtualRobot& robot, int poses, std::uint64_t seed) {
  TrainOptions options;
  options.level = "M1";
  options.bias = "se";
  options.seed = seed;
  return test::demand(train(robot.truth.cell, test::measured(robot, poses, seed), options));
}

/// Share of the coordinates of the true error at fresh poses that lie in their 95 % interval.
double inside(const VirtualRobot& robot, const CompensatedModel& model) {
  const MeasurementBatch fresh = test::measured(robot, 200, 900);
  double count = 0;
  for (const Measurement& m : fresh.measurements) {
    const ErrorPrediction said = model.predict(m.context.q, m.context.tool, m.context.payload);
    const Vector3 real_B =
        (robot.truth.X_WB.inverse() * robot.truth.pose_W(m.context)).translation();
    const Vector3 missed = real_B - said.X_BT_predicted.translation();
    count +=
        static_cast<double>((missed.array().abs() < 1.96 * said.true_stddev_B.array()).count());
  }
  return count / (3.0 * static_cast<double>(fresh.measurements.size()));
}

TEST(BiasSpread, AModelOfFewPosesKnowsHowFarItMisses) {
  const VirtualRobot robot = test::chapter_5_robot(test::cell_7());
  double with = 0, without = 0;
  constexpr int kModels = 6;
  for (int seed = 1; seed <= kModels; ++seed) {
    const CompensatedModel model = trained(robot, 60, static_cast<std::uint64_t>(seed));
    EXPECT_GE(model.parts().bias_spread, 1);
    CompensatedModel::Parts parts = model.parts();
    parts.bias_spread = 1;
    with += inside(robot, model) / kModels;
    without += inside(robot, test::demand(CompensatedModel::make(parts))) / kModels;
  }
  EXPECT_GT(with, 0.92);
  EXPECT_LT(with, 0.985);
  EXPECT_GT(with, without + 0.01);
}

/// Maps of all joints fit noise, too; the kernel learns of what they leave, which is too little.
TEST(BiasSpread, AModelOfManyPosesCountsWhatItsPhysicsFittedOfTheNoise) {
  const VirtualRobot robot = test::chapter_5_robot(test::cell_7());
  TrainOptions options;
  options.level = "M1,joint_map:*@20";
  options.bias = "se";
  const CompensatedModel model =
      test::demand(train(robot.truth.cell, test::measured(robot, 220, 1), options));
  EXPECT_GT(model.parts().bias_spread, 1.02);
  EXPECT_GT(inside(robot, model), 0.92);
  EXPECT_LT(inside(robot, model), 0.985);
}

}  // namespace
}  // namespace trammel
