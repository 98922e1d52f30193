#include "server/calibrate/jump.h"

#include <gtest/gtest.h>

#include "tests/support/learning_cell.h"
#include "tests/support/virtual_robot.h"

namespace trammel {
namespace {

using test::measured_on;

constexpr std::size_t kHalf = 100;

/// 200 poses; from the 101st on measured of another robot.
MeasurementBatch changed_halfway(const VirtualRobot& before, const VirtualRobot& after, std::uint64_t seed) {
  MeasurementBatch batch = measured_on(before, {.poses = 2 * kHalf, .seed = seed});
  const MeasurementBatch later = measured_on(after, {.poses = 2 * kHalf, .seed = seed});
  for (std::size_t i = kHalf; i < 2 * kHalf; ++i) {
    batch.measurements[i].p_W = later.measurements[i].p_W;
    batch.measurements[i].R_WT = later.measurements[i].R_WT;
  }
  return batch;
}

TEST(Jump, AZeroLostHalfwayIsFoundWithItsPoseAndItsSize) {
  const auto cell = test::cell_7();
  const VirtualRobot robot = test::chapter_5_robot(cell);
  for (int joint = 2; joint <= 5; ++joint) {
    const MeasurementBatch batch =
        changed_halfway(robot, test::with_zero_off(robot, joint, 3e-4), 40 + static_cast<std::uint64_t>(joint));
    const auto jump = jump_within(cell, batch);
    ASSERT_TRUE(jump) << "joint " << joint;
    EXPECT_EQ(jump->source.substr(0, 12), fmt::format("joint_slip:{}", joint));
    EXPECT_NEAR(jump->row, batch.measurements[kHalf].row, 2) << "joint " << joint;
    EXPECT_GT(jump->effect, 2e-5);
    EXPECT_LT(jump->effect, 1e-3);
    EXPECT_NE(in_words(*jump).find(fmt::format("lost zero in joint {}", joint)), std::string::npos) << in_words(*jump);
  }
}

TEST(Jump, ATrackerThatWasBumpedAndAToolThatWasKnockedAreFound) {
  const auto cell = test::cell_7();
  const VirtualRobot robot = test::chapter_5_robot(cell);
  MeasurementBatch bumped = measured_on(robot, {.poses = 200, .seed = 5});
  const Matrix3 turn = rotation_exp(Vector3(0, 0, 1e-4));
  for (std::size_t i = kHalf; i < bumped.measurements.size(); ++i) {
    Measurement& m = bumped.measurements[i];
    m.p_W = turn * m.p_W + Vector3(1e-4, 0, 0);
    if (m.R_WT) m.R_WT = (turn * *m.R_WT).eval();
  }
  const auto moved = jump_within(cell, bumped);
  ASSERT_TRUE(moved);
  EXPECT_EQ(moved->pose_id, bumped.measurements[kHalf].pose_id);
  VirtualRobot knocked = robot;
  knocked.truth.tools.at("spindle").translation() += Vector3(2e-4, 0, 1e-4);
  const MeasurementBatch batch = changed_halfway(robot, knocked, 6);
  const auto tool = jump_within(cell, batch);
  ASSERT_TRUE(tool);
  EXPECT_EQ(tool->source, "tool_changed@101");
}

TEST(Jump, ThereIsNoneInAGoodBatch) {
  const auto cell = test::cell_7();
  const VirtualRobot robot = test::chapter_5_robot(cell);
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const auto jump = jump_within(cell, measured_on(robot, {.poses = 200, .seed = 300 + seed}));
    EXPECT_FALSE(jump) << in_words(*jump);
  }
}

TEST(Jump, WhatGrowsSlowlyIsNone) {
  const auto cell = test::cell_7();
  const VirtualRobot robot = test::chapter_5_robot(cell);
  for (const double lag : {0.1, 0.3, 10.0}) {
    MeasurementBatch batch = measured_on(robot, {.poses = 200, .seed = 11});
    for (std::size_t i = 0; i < 200; ++i) {
      const double grown = (1 - std::exp(-static_cast<double>(i) / (200 * lag))) / (1 - std::exp(-1 / lag));
      batch.measurements[i].p_W += Vector3(5e-5, 2e-5, 1e-4) * grown;
    }
    const auto jump = jump_within(cell, batch);
    EXPECT_FALSE(jump) << in_words(*jump);
  }
}

}  // namespace
}  // namespace trammel
