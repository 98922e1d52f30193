#include "server/calibrate/batch_check.h"

#include <gtest/gtest.h>

#include "server/measurement/checked_batch.h"
#include "tests/support/demand.h"
#include "tests/support/misread_batch.h"
#include "tests/support/one_point.h"
#include "tests/support/virtual_robot.h"

namespace trammel {
namespace {

using test::FirstBatch;

/// The next batch of a new cell in which the mistake can show.
FirstBatch drawn(std::uint64_t seed, const test::Misreading& mistake) {
  FirstBatch first = test::first_batch(seed, test::Robots::kOfSixJoints);
  first.poses = std::max(first.poses, 25);
  first.spread = std::max(first.spread, 0.4);
  first.orientation = first.orientation || mistake.needs_orientation;
  first.tool_known = first.tool_known || mistake.kind == "another point of the tool";
  return first;
}

class Misread : public testing::TestWithParam<std::size_t> {};

TEST_P(Misread, AFirstBatchIsRefusedWithTheReadingThatFits) {
  const test::Misreading& mistake = test::misreadings()[GetParam()];
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const FirstBatch first = drawn(seed, mistake);
    const auto cell = test::new_cell(first);
    MeasurementBatch batch = test::measured_first(first, *cell);
    std::mt19937_64 random(seed);
    const std::string reading = mistake.make(batch, *cell, random);
    const auto said = test::said_of(std::move(batch), *cell);
    ASSERT_TRUE(said) << mistake.kind << ", seed " << seed << ": " << reading;
    EXPECT_EQ(said->code, ErrorCode::kRefused);
    EXPECT_TRUE(test::names(*said, reading))
        << mistake.kind << ", seed " << seed << ": expected '" << reading << "', not: " << sentence(*said);
  }
}

std::string kind_of(const testing::TestParamInfo<std::size_t>& mistake) {
  std::string name;
  for (const char c : test::misreadings()[mistake.param].kind) name += std::isalnum(c) != 0 ? c : '_';
  return name;
}

INSTANTIATE_TEST_SUITE_P(Kinds, Misread, testing::Range<std::size_t>(0, test::misreadings().size()), kind_of);

TEST(BatchCheck, RobotsAsTheyAreDeliveredAreNotDoubtedHoweverBadlyTheyWereMastered) {
  for (std::uint64_t seed = 1; seed <= 25; ++seed) {
    const FirstBatch first = test::first_batch(seed, test::Robots::kAll);
    const auto cell = test::new_cell(first);
    const auto said = test::said_of(test::measured_first(first, *cell), *cell);
    EXPECT_FALSE(said) << first.robot << ", seed " << seed << ": " << sentence(*said);
  }
}

TEST(BatchCheck, PositionsThatSayTheyAreFarWorseThanTheyAreAreDoubted) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    FirstBatch first = test::first_batch(seed, test::Robots::kOfSixJoints);
    first.poses = std::max(first.poses, 30);
    const auto cell = test::new_cell(first);
    MeasurementBatch batch = test::measured_first(first, *cell);
    for (Measurement& m : batch.measurements) m.sigma = 5e-3;
    const auto said = test::said_of(std::move(batch), *cell);
    ASSERT_TRUE(said) << first.robot << ", seed " << seed;
    EXPECT_EQ(said->field, "sigma_mm") << sentence(*said);
  }
}

TEST(BatchCheck, AToolOfAnotherNameIsNamed) {
  auto cell = std::make_shared<Cell>(*test::cell_7());
  Pose probe = *cell->tools.at("spindle");
  probe.translation() += Vector3(0.03, 0.05, 0.12);
  cell->tools["probe"] = probe;
  MeasurementBatch batch = test::measured(test::chapter_5_robot(test::cell_7()), 80, 5);
  const Pose spindle = *cell->tools.at("spindle");
  const Vector3 apart = spindle.linear().transpose() * (probe.translation() - spindle.translation());  // in T
  for (Measurement& m : batch.measurements) m.p_W += *m.R_WT * apart;
  for (Measurement& m : batch.measurements) m.context.tool = "spindle";
  const auto said = test::said_of(std::move(batch), *cell);
  ASSERT_TRUE(said);
  EXPECT_EQ(said->text, "those of tool 'probe'") << sentence(*said);
}

TEST(BatchCheck, ToolsMayTakeTurnsInAnyOrder) {
  auto cell = std::make_shared<Cell>(*test::cell_7());
  Pose probe = *cell->tools.at("spindle");
  probe.translation() += Vector3(0.03, 0.05, 0.12);
  cell->tools["probe"] = probe;
  const Vector3 apart = cell->tools.at("spindle")->linear().transpose() * Vector3(0.03, 0.05, 0.12);  // in T
  const MeasurementBatch of_one = test::measured(test::chapter_5_robot(test::cell_7()), 160, 5);
  for (const std::size_t every : {2u, 3u, 5u, 80u, 159u}) {
    MeasurementBatch batch = of_one;
    for (std::size_t i = every - 1; i < batch.measurements.size(); i += every) {
      Measurement& m = batch.measurements[i];
      m.context.tool = "probe";
      m.p_W += *m.R_WT * apart;
    }
    const auto said = test::said_of(std::move(batch), *cell);
    EXPECT_FALSE(said) << "each " << every << ": " << sentence(*said);
  }
}

TEST(BatchCheck, OnePointSeenFromAllSidesWithAToolThatIsOffIsNotReadAsPositionsInUm) {
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    const auto known = test::cell_of_one_point("{xyz_mm: [0, 0, 0]}", test::kToolOfOnePoint, "{error_sources: []}");
    const auto unknown = test::cell_of_one_point("null", test::kToolOfOnePoint, "{error_sources: []}");
    const Vector3 off = 1e-3 * Vector3(4, -3, 6);
    const auto said = test::said_of(test::one_point(*known, off, Pose::Identity(), 30, seed), *known);
    EXPECT_FALSE(said) << "seed " << seed << ": " << sentence(*said);
    const Pose X_WB = make_pose(rotation_exp({0.3, -1.1, 1.9}), {1.2, -0.5, 0.3});
    const auto elsewhere = test::said_of(test::one_point(*unknown, off, X_WB, 30, seed), *unknown);
    EXPECT_FALSE(elsewhere) << "seed " << seed << ": " << sentence(*elsewhere);
  }
}

TEST(BatchCheck, PositionsThatAreInUmAreStillNamed) {
  const auto cell = test::cell_7();
  MeasurementBatch batch = test::measured(test::chapter_5_robot(cell), 60, 3);
  for (Measurement& m : batch.measurements) m.p_W *= 1000;
  const auto said = test::said_of(std::move(batch), *cell);
  ASSERT_TRUE(said);
  EXPECT_EQ(said->text, "with all positions in um") << sentence(*said);
}

TEST(BatchCheck, WhatIsRefusedForALimitSaysUnderWhichReadingItWouldNotBe) {
  MeasurementBatch batch = test::measured(test::chapter_5_robot(test::cell_7()), 60, 3);
  for (Measurement& m : batch.measurements) std::swap(m.context.q(1), m.context.q(3));
  const auto checked = check_against_cell(std::move(batch), *test::cell_7());
  ASSERT_FALSE(checked);
  EXPECT_EQ(checked.error().text, "with q2_deg and q4_deg exchanged") << sentence(checked.error());
  EXPECT_TRUE(checked.error().row) << "the limit that was broken";
}

}  // namespace
}  // namespace trammel
