#include "server/calibrate/jump.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/learning_cell.h"
#include "tests/support/virtual_robot.h"

namespace trammel {
namespace {

using test::measured_on;

constexpr std::size_t kHalf = 100;

/// 200 poses; from the 101st on measured of another robot.
MeasurementBatch changed_halfway(const VirtualRobot& before, const VirtualRobot& after,
                                 std::uint64_t seed) {
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
    const MeasurementBatch batch = changed_halfway(robot, test::with_zero_off(robot, joint, 3e-4),
                                                   40 + static_cast<std::uint64_t>(joint));
    const auto jump = jump_within(cell, batch);
    ASSERT_TRUE(jump) << "joint " << joint;
    EXPECT_EQ(jump->source.substr(0, 12), fmt::format("joint_slip:{}", joint));
    EXPECT_NEAR(jump->row, batch.measurements[kHalf].row, 2) << "joint " << joint;
    EXPECT_GT(jump->effect, 2e-5);
    EXPECT_LT(jump->effect, 1e-3);
    EXPECT_NE(in_words(*jump).find(fmt::format("lost zero in joint {}", joint)), std::string::npos)
        << in_words(*jump);
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

/// `batch` with the share `course` (0 to 1) of the way to what was measured of another robot at the
/// same poses.
template <typename Course>
MeasurementBatch on_the_way(MeasurementBatch batch, const MeasurementBatch& other,
                            const Course& course) {
  const auto n = static_cast<double>(batch.measurements.size());
  for (std::size_t i = 0; i < batch.measurements.size(); ++i) {
    Measurement& m = batch.measurements[i];
    m.p_W += course(static_cast<double>(i) / n) * (other.measurements[i].p_W - m.p_W);
  }
  return batch;
}

TEST(Jump, AReflectorThatWasPutOnAnewIsFoundHoweverFarOffItSits) {
  const auto cell = test::cell_7();
  const VirtualRobot robot = test::chapter_5_robot(cell);
  for (const double mm : {0.1, 0.5, 1.0}) {
    for (const Vector3& way :
         {Vector3(0.48, -0.6, 0.64), Vector3(1, 0, 0), Vector3(0, 1, 0), Vector3(0, 0, 1)}) {
      VirtualRobot other = robot;
      other.truth.tools.at("spindle").translation() += mm * 1e-3 * way;
      const auto jump = jump_within(cell, changed_halfway(robot, other, 71));
      ASSERT_TRUE(jump) << mm << " mm along " << way.transpose();
      EXPECT_EQ(jump->source, "tool_changed@101") << mm << " mm along " << way.transpose();
    }
  }
}

TEST(Jump, ATrackerThatWasMovedFarIsFoundWithItsPoseAndItsSize) {
  const auto cell = test::cell_7();
  const VirtualRobot robot = test::chapter_5_robot(cell);
  for (const std::size_t poses : {40u, 80u}) {
    for (const double mm : {3.0, 10.0, 50.0}) {
      MeasurementBatch batch =
          measured_on(robot, {.poses = static_cast<int>(poses), .seed = 90 + poses});
      const Matrix3 turn = rotation_exp(Vector3(0, 0, 2e-4 * mm));
      double square = 0;
      for (std::size_t i = poses / 2; i < poses; ++i) {
        Measurement& m = batch.measurements[i];
        const Vector3 before = m.p_W;
        m.p_W = turn * m.p_W + mm * 1e-3 * Vector3(0.8, 0, -0.6);
        if (m.R_WT) m.R_WT = (turn * *m.R_WT).eval();
        square += (m.p_W - before).squaredNorm() / static_cast<double>(poses - poses / 2);
      }
      const auto jump = jump_within(cell, batch);
      ASSERT_TRUE(jump) << poses << " poses, " << mm << " mm";
      EXPECT_EQ(jump->source.substr(0, 13), "tracker_moved") << poses << " poses, " << mm << " mm";
      EXPECT_EQ(jump->pose_id, batch.measurements[poses / 2].pose_id)
          << poses << " poses, " << mm << " mm";
      EXPECT_NEAR(jump->effect, std::sqrt(square), 0.1 * std::sqrt(square))
          << poses << " poses, " << mm << " mm";
    }
  }
}

TEST(Jump, WhatComesAndGoesOrSwaysIsNone) {
  const auto cell = test::cell_7();
  const VirtualRobot robot = test::chapter_5_robot(cell);
  const VirtualRobot hot = test::with_zero_off(test::with_zero_off(robot, 2, 3e-4), 3, -2e-4);
  const auto heated_and_cooled = [](double x) {
    return x < 0.5 ? 1 - std::exp(-x / 0.1) : std::exp((0.5 - x) / 0.1);
  };
  for (std::uint64_t seed = 21; seed <= 25; ++seed) {
    const test::Day day{.poses = 2 * kHalf, .seed = seed};
    const auto heat = jump_within(
        cell, on_the_way(measured_on(robot, day), measured_on(hot, day), heated_and_cooled));
    EXPECT_FALSE(heat) << in_words(*heat);
    MeasurementBatch swayed = measured_on(robot, day);
    for (std::size_t i = 0; i < 2 * kHalf; ++i) {
      const double phase = static_cast<double>(seed) + 0.05 * static_cast<double>(i);
      swayed.measurements[i].p_W += Vector3(6e-5, -3e-5, 7e-5) * std::sin(phase);
    }
    const auto sway = jump_within(cell, swayed);
    EXPECT_FALSE(sway) << in_words(*sway);
  }
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
      const double grown =
          (1 - std::exp(-static_cast<double>(i) / (200 * lag))) / (1 - std::exp(-1 / lag));
      batch.measurements[i].p_W += Vector3(5e-5, 2e-5, 1e-4) * grown;
    }
    const auto jump = jump_within(cell, batch);
    EXPECT_FALSE(jump) << in_words(*jump);
  }
}

}  // namespace
}  // namespace trammel
