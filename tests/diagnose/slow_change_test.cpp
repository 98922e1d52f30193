#include "server/diagnose/tell/slow_change.h"

#include <gtest/gtest.h>

#include <cmath>

#include "server/diagnose/diagnose.h"
#include "tests/support/demand.h"
#include "tests/support/virtual_robot.h"

// What moved in the course of a batch is told by its size and its course.

namespace trammel::cause_search {
namespace {

/// cell-7's virtual robot, whose joint 3 is off by `zero(share of the batch)`, rad.
Diagnosis diagnosed(const std::function<double(double)>& zero, std::uint64_t seed) {
  const auto cell = test::cell_7();
  const VirtualRobot robot = test::chapter_5_robot(cell);
  MeasurementBatch batch = test::measured(robot, 80, seed);
  for (std::size_t i = 0; i < batch.measurements.size(); ++i) {
    Measurement& m = batch.measurements[i];
    m.context.time = 30.0 * static_cast<double>(i);
    const VirtualRobot off = test::with_zero_off(
        robot, 3, zero(static_cast<double>(i) / static_cast<double>(batch.measurements.size())));
    const Pose moved = off.truth.pose_W(m.context) * robot.truth.pose_W(m.context).inverse();
    m.p_W = moved * m.p_W;
    m.R_WT = moved.linear() * *m.R_WT;
  }
  DiagnoseOptions options;
  options.draws = 200;
  options.recovery = false;
  options.next_poses = 0;
  return test::demand(diagnose(cell, batch, options));
}

TEST(SlowChange, ThreeLostZerosAreNoWarmingUp) {
  for (const std::uint64_t seed : {1, 2}) {
    const Diagnosis slips = diagnosed(
        [](double t) { return t < 0.25   ? 0
                              : t < 0.5  ? 1.4e-3
                              : t < 0.75 ? 3.5e-3
                                         : 7e-3; }, seed);
    EXPECT_EQ(slips.sentence.find("warm up"), std::string::npos) << slips.sentence;
    EXPECT_NE(slips.sentence.find("in steps"), std::string::npos) << slips.sentence;
    EXPECT_NE(slips.sentence.find("joint 3"), std::string::npos) << slips.sentence;
  }
}

TEST(SlowChange, AZeroThatCreepsByAFewHundredthsOfAMillimetreMayBeWarmingUp) {
  const Diagnosis warm = diagnosed([](double t) { return 2e-4 * std::sin(5 * t) * t; }, 3);
  EXPECT_NE(warm.sentence.find("The zero of joint 3 moved slowly"), std::string::npos)
      << warm.sentence;
  EXPECT_NE(warm.sentence.find("as parts do that warm up"), std::string::npos) << warm.sentence;
}

TEST(SlowChange, AZeroThatCreepsByMilliradiansIsMoreThanThat) {
  const Diagnosis large = diagnosed([](double t) { return 6e-3 * std::sin(5 * t) * t; }, 4);
  EXPECT_EQ(large.sentence.find("as parts do that warm up"), std::string::npos) << large.sentence;
}

/// cell-7's virtual robot, whose tool creeps by up to `size`, m, there and back.
Diagnosis with_creeping_tool(double size, std::uint64_t seed) {
  const auto cell = test::cell_7();
  const VirtualRobot robot = test::chapter_5_robot(cell);
  MeasurementBatch batch = test::measured(robot, 80, seed);
  for (std::size_t i = 0; i < batch.measurements.size(); ++i) {
    Measurement& m = batch.measurements[i];
    m.context.time = 30.0 * static_cast<double>(i);
    const double gone = size * std::sin(3.1 * static_cast<double>(i) /
                                        static_cast<double>(batch.measurements.size()));
    m.p_W += robot.truth.pose_W(m.context).linear() * Vector3(gone, 0, 0);
  }
  DiagnoseOptions options;
  options.draws = 200;
  options.recovery = false;
  options.next_poses = 0;
  return test::demand(diagnose(cell, batch, options));
}

TEST(SlowChange, AToolThatCreepsByMillimetresIsNoWarmingUpAndByATenthItMayBe) {
  const Diagnosis large = with_creeping_tool(4e-3, 5);
  EXPECT_EQ(large.sentence.find("as parts do that warm up"), std::string::npos) << large.sentence;
  const Diagnosis small = with_creeping_tool(1.5e-4, 5);
  EXPECT_NE(small.sentence.find("as parts do that warm up"), std::string::npos) << small.sentence;
}

}  // namespace
}  // namespace trammel::cause_search
