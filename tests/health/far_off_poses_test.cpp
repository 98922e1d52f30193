// Checks whose poses are farther off than any change of the robot takes them.
#include <gtest/gtest.h>

#include <functional>
#include <random>

#include "server/health/health_check.h"
#include "tests/support/checked_robot.h"
#include "tests/support/demand.h"

namespace trammel {
namespace {

using test::CheckedRobot;

/// One robot for all tests: trained on 200 poses, checked by twelve planned ones.
class FarOffPoses : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    robot_ = new CheckedRobot(test::trained_robot({.seed = 3, .poses = 200}));
  }
  static void TearDownTestSuite() {
    delete robot_;
    robot_ = nullptr;
  }
  /// Spoils the pose of that place in the batch.
  using Spoiling = std::function<void(Measurement& m, int place)>;
  static Result<HealthCheck> checked(std::uint64_t seed, const Spoiling& spoil) {
    MeasurementBatch batch = test::measured_check(*robot_, {}, seed);
    int place = 0;
    for (Measurement& m : batch.measurements) spoil(m, place++);
    return check_health(robot_->model,
                        test::demand(check_against_cell(batch, robot_->model.cell())),
                        {.tolerance = 50e-6});
  }
  /// Noise of that size in each coordinate, m, drawn anew with each pose.
  static Spoiling noise(std::uint64_t seed, double size) {
    return [=, random = std::mt19937_64(seed), normal = std::normal_distribution<double>()](
               Measurement& m, int) mutable {
      m.p_W += size * Vector3(normal(random), normal(random), normal(random));
    };
  }

  static CheckedRobot* robot_;
};
CheckedRobot* FarOffPoses::robot_ = nullptr;

TEST_F(FarOffPoses, AFileThatWasReadOtherwiseThanItWasMeantIsNoChangeOfTheRobot) {
  const auto check = checked(4, [](Measurement& m, int) { m.context.q(4) *= -1; });
  ASSERT_FALSE(check) << check->sentence;
  EXPECT_EQ(check.error().code, ErrorCode::kRefused);
}

TEST_F(FarOffPoses, OfPosesThatAreFarOffOnlyAnotherToolIsNamed) {
  const HealthCheck tool = test::demand(
      checked(5, [](Measurement& m, int) { m.p_W += *m.R_WT * Vector3(0.03, -0.02, 0.01); }));
  ASSERT_EQ(tool.changed.size(), 1u) << tool.sentence;
  EXPECT_EQ(tool.changed.front().cause.record->spelling.substr(0, 4), "tool");
  const auto nothing = checked(5, [](Measurement& m, int place) {
    m.p_W += Vector3::Unit(place % 3) * (place % 2 == 0 ? 0.03 : -0.03);
  });
  if (!nothing) return;  // taken for a mistake of reading
  EXPECT_EQ(nothing->verdict, HealthVerdict::kCannotTell) << nothing->sentence;
  EXPECT_TRUE(nothing->changed.empty());
}

TEST_F(FarOffPoses, PosesThatAreNotThisRobotsAreNeverCalledChance) {
  const Spoiling spoil = noise(7, 0.04);
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const auto check = checked(seed, spoil);
    if (!check) continue;  // taken for a mistake of reading
    EXPECT_EQ(check->sentence.find("chance"), std::string::npos) << check->sentence;
    EXPECT_EQ(check->verdict, HealthVerdict::kCannotTell) << check->sentence;
    EXPECT_NE(check->sentence.find("was the file read as it was meant"), std::string::npos)
        << check->sentence;
  }
}

}  // namespace
}  // namespace trammel
