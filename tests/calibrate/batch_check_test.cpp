#include "server/calibrate/batch_check.h"

#include <gtest/gtest.h>

#include "server/base/units.h"
#include "server/measurement/checked_batch.h"
#include "tests/support/demand.h"
#include "tests/support/gauged_arm.h"
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
    EXPECT_TRUE(test::names(*said, reading)) << mistake.kind << ", seed " << seed << ": expected '"
                                             << reading << "', not: " << sentence(*said);
  }
}

std::string kind_of(const testing::TestParamInfo<std::size_t>& mistake) {
  std::string name;
  for (const char c : test::misreadings()[mistake.param].kind)
    name += std::isalnum(c) != 0 ? c : '_';
  return name;
}

INSTANTIATE_TEST_SUITE_P(Kinds, Misread, testing::Range<std::size_t>(0, test::misreadings().size()),
                         kind_of);

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
  const Vector3 apart =
      spindle.linear().transpose() * (probe.translation() - spindle.translation());  // in T
  for (Measurement& m : batch.measurements) m.p_W += *m.R_WT * apart;
  for (Measurement& m : batch.measurements) m.context.tool = "spindle";
  const auto said = test::said_of(std::move(batch), *cell);
  ASSERT_TRUE(said);
  EXPECT_EQ(said->text, "those of tool 'probe'") << sentence(*said);
}

TEST(BatchCheck, AToolWithAnotherSignInItsPlaceIsNoMistakeInAJoint) {
  auto cell = std::make_shared<Cell>(*test::cell_7());
  VirtualRobot robot = test::chapter_5_robot(test::cell_7());
  const Vector3 point(0.08, -0.06, 0.15);
  robot.truth.tools.at("spindle").translation() = point;
  const MeasurementBatch batch = test::measured(robot, 60, 5, false);
  for (int k = 0; k < 3; ++k) {
    Vector3 drawn = point;
    drawn(k) *= -1;
    cell->tools["spindle"] = make_pose(Matrix3::Identity(), drawn);
    const auto said = test::said_of(batch, *cell);
    ASSERT_TRUE(said) << k;
    EXPECT_EQ(said->text, "another point of the tool") << k << ": " << sentence(*said);
  }
}

TEST(BatchCheck, ToolsMayTakeTurnsInAnyOrder) {
  auto cell = std::make_shared<Cell>(*test::cell_7());
  Pose probe = *cell->tools.at("spindle");
  probe.translation() += Vector3(0.03, 0.05, 0.12);
  cell->tools["probe"] = probe;
  const Vector3 apart =
      cell->tools.at("spindle")->linear().transpose() * Vector3(0.03, 0.05, 0.12);  // in T
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

/// Each pose of `of_one` in as many rows as there are `reflectors` (m, from the tool's point, in
/// T).
MeasurementBatch seen_by(const std::vector<Vector3>& reflectors, const MeasurementBatch& of_one) {
  MeasurementBatch batch = of_one;
  batch.measurements.clear();
  for (const Measurement& m : of_one.measurements) {
    for (const Vector3& reflector : reflectors) {
      Measurement row = m;
      row.p_W += *m.R_WT * reflector;
      row.pose_id = fmt::format("{}", batch.measurements.size());
      row.row = static_cast<int>(batch.measurements.size()) + 2;
      row.context.index = static_cast<int>(batch.measurements.size());
      batch.measurements.push_back(std::move(row));
    }
  }
  return batch;
}

TEST(BatchCheck, SeveralReflectorsUnderOneNameAreNotAveraged) {
  const auto cell = test::cell_7();
  const MeasurementBatch of_one = test::measured(test::chapter_5_robot(cell), 40, 5);
  const std::vector<Vector3> two = {Vector3::Zero(), Vector3(0.02, 0.01, 0)};
  const std::vector<Vector3> three = {Vector3::Zero(), Vector3(0.1, 0, 0.05), Vector3(0, 0.1, 0)};
  for (const auto& reflectors : {two, three}) {
    const auto said = test::said_of(seen_by(reflectors, of_one), *cell);
    ASSERT_TRUE(said) << reflectors.size();
    EXPECT_EQ(said->field, "tool_id") << sentence(*said);
    EXPECT_EQ(said->text, "several points of the tool") << sentence(*said);
  }
  MeasurementBatch one_after_the_other = seen_by({Vector3::Zero()}, of_one);
  for (const Measurement& m : seen_by({three.back()}, of_one).measurements)
    one_after_the_other.measurements.push_back(m);
  const auto blocks = test::said_of(one_after_the_other, *cell);
  ASSERT_TRUE(blocks);
  EXPECT_EQ(blocks->text, "several points of the tool") << sentence(*blocks);
  MeasurementBatch repeats = seen_by({Vector3::Zero(), Vector3(2e-4, 0, 0)}, of_one);
  repeats.measurements[10].p_W += Vector3(0.3, 0, 0);  // one bad row is no second reflector
  const auto nothing = test::said_of(repeats, *cell);
  EXPECT_FALSE(nothing) << sentence(*nothing);
}

TEST(BatchCheck, APointWhosePlaceNobodyMeasuredBendsNoArmToTheOrigin) {
  const auto zeros = [](const Cell& cell) {
    MeasurementBatch batch =
        test::one_point(cell, 1e-3 * Vector3(1, -1, 2), Pose::Identity(), 30, 3);
    for (Measurement& m : batch.measurements) m.p_W.setZero();
    return batch;
  };
  const std::string model = "{error_sources: [geometry]}";
  const auto known = test::cell_of_one_point("{xyz_mm: [0, 0, 0]}", test::kToolOfOnePoint, model);
  const auto said = test::said_of(zeros(*known), *known);
  ASSERT_TRUE(said);
  EXPECT_EQ(said->text, "another place") << sentence(*said);
  EXPECT_NE(said->next.find("base: null"), std::string::npos) << sentence(*said);
  const auto elsewhere = test::cell_of_one_point("null", test::kToolOfOnePoint, model);
  const auto turned = test::said_of(zeros(*elsewhere), *elsewhere);
  ASSERT_TRUE(turned);
  EXPECT_EQ(turned->text, "one place") << sentence(*turned);
  Cell unknown = *elsewhere;
  for (auto& [name, X_FT] : unknown.tools) X_FT.reset();
  MeasurementBatch batch = zeros(*elsewhere);
  const auto nothing = test::said_of(std::move(batch), unknown);
  EXPECT_FALSE(nothing) << sentence(*nothing);
}

TEST(BatchCheck, OnePointSeenFromAllSidesWithAToolThatIsOffIsNotReadAsPositionsInUm) {
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    const auto known = test::cell_of_one_point("{xyz_mm: [0, 0, 0]}", test::kToolOfOnePoint,
                                               "{error_sources: []}");
    const auto unknown =
        test::cell_of_one_point("null", test::kToolOfOnePoint, "{error_sources: []}");
    const Vector3 off = 1e-3 * Vector3(4, -3, 6);
    const auto said =
        test::said_of(test::one_point(*known, off, Pose::Identity(), 30, seed), *known);
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

TEST(BatchCheck, ALogInRadiansAndMetresIsNamedAsOne) {
  FirstBatch first;
  first.robot = "universal-robots_ur5";
  first.base_known = first.tool_known = first.orientation = false;
  const auto cell = test::new_cell(first);
  MeasurementBatch batch = test::measured_first(first, *cell);
  for (Measurement& m : batch.measurements) {
    m.context.q *= kPi / 180;
    m.p_W /= 1000;
  }
  const auto said = test::said_of(std::move(batch), *cell);
  ASSERT_TRUE(said);
  EXPECT_EQ(said->text, "with all joints in radians and all positions in metres")
      << sentence(*said);
}

TEST(BatchCheck, PositionsThatAControllerComputedAreNoChangeOfAnArm) {
  const auto cell = test::cell_7_unlocated();
  MeasurementBatch batch =
      test::demand(
          check_against_cell(test::measured(test::chapter_5_robot(test::cell_7()), 60, 3), *cell))
          .rows();
  const auto measured = reading_doubt(batch, *cell);
  EXPECT_FALSE(measured) << sentence(*measured);
  for (Measurement& m : batch.measurements) {
    const Pose X_BT = cell->robot.flange_pose(m.context.q) * *test::cell_7()->tools.at("spindle");
    m.p_W = X_BT.translation();
    m.R_WT.reset();
  }
  const auto computed = reading_doubt(batch, *cell);
  ASSERT_TRUE(computed);
  EXPECT_EQ(computed->text, "computed") << sentence(*computed);
  EXPECT_FALSE(batch_doubt(batch, *cell)) << "a training says it as a note";
}

TEST(BatchCheck, ARobotFileInCraigsConventionIsTold) {
  for (const char* name : {"kuka_lbr-iiwa-7-r800", "universal-robots_ur5", "staubli_tx2-90l"}) {
    FirstBatch first;
    first.robot = name;
    first.orientation = false;
    first.tool_known = false;
    const auto cell = test::new_cell(first);
    std::vector<Joint> joints;
    for (int j = 0; j < cell->robot.size(); ++j) {
      Joint joint = cell->robot.joint(j);
      const LinkGeometry before = j > 0 ? cell->robot.joint(j - 1).link : LinkGeometry();
      joint.link.a = before.a;
      joint.link.alpha = before.alpha;
      joint.hayati = false;
      joints.push_back(joint);
    }
    Cell pasted = *cell;
    pasted.robot = test::demand(Chain::make("pasted", joints, cell->robot.couplings()));
    const auto said = test::said_of(test::measured_first(first, *cell), pasted);
    ASSERT_TRUE(said) << name;
    EXPECT_TRUE(test::names(*said, "with a and alpha of the robot file one row up"))
        << name << ": " << sentence(*said);
    EXPECT_EQ(said->field, "a_mm,alpha_deg");
  }
}

TEST(BatchCheck, ARowInAnotherUnitThanTheOthersIsNamedWithIt) {
  for (const auto& [unit, factor] : {std::pair("metres", 1e-3), std::pair("inches", 1 / 25.4)}) {
    for (const bool known : {true, false}) {
      auto cell = std::make_shared<Cell>(*test::cell_7());
      if (!known) {
        cell->X_WB.reset();
        cell->tools["spindle"].reset();
      }
      MeasurementBatch batch = test::measured(test::chapter_5_robot(test::cell_7()), 60, 3, known);
      for (std::size_t i = 0; i < batch.measurements.size(); ++i)
        batch.measurements[i].row = static_cast<int>(i) + 2;
      batch.measurements[16].p_W *= factor;
      const auto one = test::said_of(batch, *cell);
      ASSERT_TRUE(one) << unit << (known ? "" : ", base and tool unknown");
      EXPECT_EQ(one->row, 18) << sentence(*one);
      EXPECT_EQ(one->text, std::string("in ") + unit) << sentence(*one);
      batch.measurements[40].p_W *= factor;
      const auto two = test::said_of(batch, *cell);
      ASSERT_TRUE(two);
      EXPECT_NE(two->message.find("rows 18, 42; read in"), std::string::npos) << sentence(*two);
    }
  }
}

TEST(BatchCheck, DistancesInAnotherUnitAreNamedAllOfThemAndSingleRows) {
  for (const bool known : {true, false}) {
    const test::GaugedArm arm = test::gauged_arm(
        3, test::three_corners(), known ? "" : test::unknown_places(test::three_corners()));
    const MeasurementBatch good = test::gauge_batch(arm, test::wire_rows(arm, 80, 3), 0.05, 3);
    const auto nothing = batch_doubt(good, *arm.cell);
    EXPECT_FALSE(nothing) << sentence(*nothing);
    for (const auto& [unit, factor] :
         {std::pair("in metres", 1e-3), std::pair("in inches", 1 / 25.4)}) {
      MeasurementBatch all = good, one = good;
      for (Measurement& m : all.measurements) m.gauge->value *= factor;
      one.measurements[16].gauge->value *= factor;
      const auto of_all = batch_doubt(all, *arm.cell), of_one = batch_doubt(one, *arm.cell);
      ASSERT_TRUE(of_all && of_one) << unit << (known ? "" : ", places unknown");
      EXPECT_EQ(of_all->text, unit) << sentence(*of_all);
      EXPECT_EQ(of_one->text, unit) << sentence(*of_one);
      EXPECT_EQ(of_one->row, good.measurements[16].row) << sentence(*of_one);
    }
  }
}

TEST(BatchCheck, OneWireOfThreeInInchesIsNamedByItsAnchor) {
  for (const std::uint64_t seed : {3, 4, 5}) {
    const test::GaugedArm arm = test::gauged_arm(seed, test::three_corners());
    MeasurementBatch batch = test::gauge_batch(arm, test::wire_rows(arm, 90, seed), 0.05, seed);
    for (Measurement& m : batch.measurements)
      if (m.gauge->anchor == "a2") m.gauge->value /= 25.4;
    const auto said = batch_doubt(batch, *arm.cell);
    ASSERT_TRUE(said) << seed;
    EXPECT_EQ(said->text, "in inches") << sentence(*said);
    EXPECT_NE(said->message.find("anchor 'a2'"), std::string::npos) << sentence(*said);
  }
}

TEST(BatchCheck, AnAnchorWhosePlaceIsWrittenWithAnotherSignOrOrderIsNamed) {
  const std::string kMeant[5][2] = {
      {"a1: {xyz_mm: [2300, -1500, 100]}, a2: {xyz_mm: [1900, -1700, 400]}, a3: {xyz_mm: [2600, "
       "200, 2600]}",
       "anchor 'a2' with the other sign of its y"},
      {"a1: {xyz_mm: [-1500, 2300, 100]}, a2: {xyz_mm: [1900, 1700, 400]}, a3: {xyz_mm: [2600, "
       "200, 2600]}",
       "anchor 'a1' with its x and y exchanged"},
      {"a1: {xyz_mm: [1900, 1700, 400]}, a2: {xyz_mm: [2300, -1500, 100]}, a3: {xyz_mm: [2600, "
       "200, 2600]}",
       "anchor 'a1' with the place of 'a2'"},
      {"a1: {xyz_mm: [2300, -1500, 100]}, a2: {xyz_mm: [1900, 1700, 400]}, a3: {xyz_mm: [2600, "
       "200, 1600]}",
       "anchor 'a3' at another place"},
      {"a1: {xyz_mm: [2300, -1500, 100]}, a2: {xyz_mm: [1900, 1700, 400]}, a3: {xyz_mm: [2.6, "
       "0.2, 2.6]}",
       "anchor 'a3' with its place in metres"}};
  for (const auto& [anchors, reading] : kMeant) {
    const test::GaugedArm arm = test::gauged_arm(3, test::three_corners(), "{" + anchors + "}");
    const auto said =
        batch_doubt(test::gauge_batch(arm, test::wire_rows(arm, 90, 3), 0.05, 3), *arm.cell);
    ASSERT_TRUE(said) << reading;
    EXPECT_EQ(said->text, reading) << sentence(*said);
  }
}

TEST(BatchCheck, WiresOfArmsAsTheyAreDeliveredAreNotDoubted) {
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    const test::GaugedArm arm = test::gauged_arm(seed, test::three_corners());
    const auto said =
        batch_doubt(test::gauge_batch(arm, test::wire_rows(arm, 60, seed), 0.05, seed), *arm.cell);
    EXPECT_FALSE(said) << seed << ": " << sentence(*said);
    const auto with_zero = batch_doubt(
        test::gauge_batch(arm, test::wire_rows(arm, 60, seed, 40), 0.05, seed), *arm.cell);
    EXPECT_FALSE(with_zero) << seed << ", zeros of 40 mm: " << sentence(*with_zero);
  }
}

TEST(BatchCheck, ATurnOfTheLastJointMayBeOneOfTheToolAndBothAreSaid) {
  const auto known = test::cell_7();
  MeasurementBatch batch = test::measured(test::chapter_5_robot(known), 60, 3, false);
  auto other = std::make_shared<Cell>(*known);
  Pose& X_FT = other->tools.at("spindle").value();
  X_FT = Pose(Eigen::AngleAxisd(kPi, Vector3::UnitZ())) * X_FT;
  const auto said = test::said_of(batch, *other);
  ASSERT_TRUE(said);
  EXPECT_NE(said->message.find("the tool of the cell file turned by"), std::string::npos)
      << sentence(*said);
}

TEST(BatchCheck, TouchesThatCountTheOtherWayOrInInchesAreNamed) {
  const test::GaugedArm arm =
      test::gauged_arm(23, {}, "{table: {xyz_mm: [1200, 0, 300], plane_normal: [0, 0, 1]}}");
  std::vector<test::GaugeRow> rows = test::position_rows(arm, 120, 23);
  for (test::GaugeRow& row : rows) {
    row.column = "touch_mm";
    row.anchor = "table";
    row.value_mm = row.p_mm.z() - 300;
  }
  const MeasurementBatch good = test::gauge_batch(arm, rows, 0.05, 23);
  const auto nothing = batch_doubt(good, *arm.cell);
  EXPECT_FALSE(nothing) << sentence(*nothing);
  for (const auto& [reading, factor] :
       {std::pair("with the other sign", -1.0), std::pair("in inches", 1 / 25.4)}) {
    MeasurementBatch misread = good;
    for (Measurement& m : misread.measurements) m.gauge->value *= factor;
    const auto said = batch_doubt(misread, *arm.cell);
    ASSERT_TRUE(said) << reading;
    EXPECT_EQ(said->text, reading) << sentence(*said);
  }
}

TEST(BatchCheck, ARowThatIsFarOffOtherwiseIsInNoOtherUnit) {
  MeasurementBatch batch = test::measured(test::chapter_5_robot(test::cell_7()), 60, 3);
  batch.measurements[16].p_W += Vector3(0.5, -0.3, 0.2);
  batch.measurements[17].p_W *= 0.5;
  const auto said = test::said_of(batch, *test::cell_7());
  EXPECT_FALSE(said) << sentence(*said);
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
