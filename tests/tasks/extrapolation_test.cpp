#include "server/tasks/train/extrapolation.h"

#include <gtest/gtest.h>

#include <numeric>

#include "server/base/units.h"
#include "server/compensate/bias_physics.h"
#include "server/compensate/domain.h"
#include "server/tasks/train/leftover.h"
#include "tests/support/demand.h"
#include "tests/support/heavy_arm.h"
#include "tests/support/outside.h"
#include "tests/support/virtual_robot.h"

namespace trammel {
namespace {

/// The 6 dim (s) range of Table 5.3.
JointRanges small_box() {
  JointRanges box;
  for (const auto& [low, high] :
       {std::pair{-15, 15}, {-15, 15}, {-15, 30}, {-30, 30}, {-30, 30}, {-30, 30}}) {
    box.emplace_back(from_deg(low), from_deg(high));
  }
  return box;
}

CalibrationResult identified(const std::shared_ptr<const Cell>& cell, const std::string& level,
                             const MeasurementBatch& batch) {
  return test::demand(calibrate(cell, test::demand(parse_level(level)), batch, {}));
}

JointVector slope_of(const CalibrationResult& found, const MeasurementBatch& batch) {
  return extrapolation_slope(LeftOut(found, batch), found.model.cell->robot);
}

BiasModel learned(const CalibrationResult& found, const MeasurementBatch& batch,
                  const std::string& kernel) {
  BiasProblem problem = leftover(found.model, batch);
  const BiasPhysics physics(found.model);
  for (const Measurement& m : batch.measurements) problem.features.push_back(physics.at(m.context));
  BiasOptions options;
  options.kernel = kernel;
  options.starts = 2;
  return test::demand(BiasModel::fit(problem, options));
}

/// Nothing is identified anew.
CalibrationResult as_it_is(CalibrationResult found) {
  found.covariance.setZero();
  found.suspects.clear();
  return found;
}

TEST(LeftOut,
     WithoutABlockTellsWhatIdentificationFromTheRestFindsHoweverUncertainTheLinksWeightsAre) {
  const test::HeavyArm arm = test::draw_heavy_arm({.seed = 3, .payloads = 0});
  const MeasurementBatch batch = test::measured(arm, 200, 1);
  const std::vector<std::string> sources = {"base", "geometry", "self_weight", "compliance_linear"};
  const CalibrationResult all = test::demand(calibrate(arm.cell, sources, batch, {}));
  std::vector<Eigen::Index> block(25);
  std::iota(block.begin(), block.end(), Eigen::Index{50});
  const auto without = LeftOut(all, batch).without(block);
  ASSERT_TRUE(without);
  MeasurementBatch fewer = batch;
  fewer.measurements.erase(fewer.measurements.begin() + 50, fewer.measurements.begin() + 75);
  const CalibrationResult rest = test::demand(calibrate(arm.cell, sources, fewer, {}));
  const Matrix3 R_BW = rest.model.X_WB.linear().transpose();
  for (const Eigen::Index i : block) {
    const Measurement& m = batch.measurements[static_cast<std::size_t>(i)];
    const Vector3 left_B = R_BW * (m.p_W - rest.model.pose_W(m.context).translation());
    EXPECT_LT((without->residual_B.row(i).transpose() - left_B).norm(), 4e-6) << "pose " << i;
  }
}

TEST(Extrapolation, FarFromItsPosesAModelClaimsNoMoreThanItKnows) {
  const VirtualRobot robot = test::chapter_5_robot(test::cell_7());
  const test::OutsideFigures figures = test::asked_outside(robot, small_box(), "M2", "se", 300, 3);
  for (const test::OutsideBand& band : figures.bands) {
    ASSERT_GT(band.poses, 300) << band.from;
    EXPECT_GT(band.coverage_95, band.to == 0 ? 0.93 : 0.90) << band.from << " to " << band.to;
    EXPECT_LT(band.stddev, 3 * band.rms) << band.from << " to " << band.to;
  }
  EXPECT_LT(figures.bands.front().coverage_95, 0.97);
  EXPECT_GT(to_mm(figures.bands.back().rms), 50 * to_mm(figures.bands.front().rms));
  EXPECT_GT(figures.caught, 0.97 * figures.outsiders);
  EXPECT_LT(figures.refused, 0.02 * figures.insiders);
}

TEST(Extrapolation, ACompletePhysicsIsTrustedFarOut) {
  const VirtualRobot robot = test::chapter_5_robot(test::cell_7());
  const test::OutsideFigures figures = test::asked_outside(robot, small_box(), "M3", "se", 300, 2);
  EXPECT_GT(figures.bands.back().coverage_95, 0.93);
  EXPECT_LT(to_mm(figures.bands.back().stddev), 0.2);
}

TEST(Extrapolation, ABiasWithParametersErrsFarOutAsPhysicsDoesAndSaysSo) {
  const VirtualRobot robot = test::chapter_5_robot(test::cell_7());
  const test::OutsideFigures figures =
      test::asked_outside(robot, small_box(), "M2", "se + parameters", 300, 2);
  for (const test::OutsideBand& band : figures.bands) {
    EXPECT_GT(band.coverage_95, 0.91) << band.from << " to " << band.to;
    EXPECT_LT(band.stddev, 3 * band.rms) << band.from << " to " << band.to;
  }
  // The bias that faded as a whole erred by 4 mm there, the physics identified as M3 by 0.05 mm.
  EXPECT_LT(to_mm(figures.bands.back().rms), 0.15);
  EXPECT_GT(figures.bands.back().stddev, 3 * figures.bands.front().stddev);
  EXPECT_GT(figures.caught, 0.987 * figures.outsiders);
  EXPECT_LT(figures.refused, 0.02 * figures.insiders + 3 * std::sqrt(0.02 * figures.insiders));
}

TEST(Extrapolation, ABiasWithMapsSaysHowMuchItErrsFarOutInPlaceAndInDirection) {
  const VirtualRobot robot = test::chapter_5_robot(test::cell_7());
  const test::OutsideFigures figures =
      test::asked_outside(robot, small_box(), "M2", "se + joint_map", 300, 1);
  for (const test::OutsideBand& band : figures.bands) {
    // More than a range out too little is claimed: half of the true error, and no slope is learned
    // of rotations.
    if (band.from >= 1) continue;
    EXPECT_GT(band.coverage_95, 0.88) << band.from << " to " << band.to;
    EXPECT_LT(band.stddev, 1.5 * band.rms) << band.from << " to " << band.to;
    EXPECT_GT(band.rotation_coverage_95, band.from < 0.3 ? 0.83 : 0.65)
        << band.from << " to " << band.to;
  }
}

TEST(Extrapolation, WhatTheParametersLeaveUncertainIsNoGrowthOfWhatMapsMiss) {
  const auto cell = test::cell_7();
  const MeasurementBatch batch =
      test::measured_within(test::chapter_5_robot(cell), small_box(), 80, 11);
  const CalibrationResult found = identified(cell, "M3", batch);
  const BiasModel bias = learned(found, batch, "se + joint_map");
  const JointVector slope = extrapolation_slope(LeftOut(found, batch), cell->robot, bias);
  EXPECT_LT(slope.norm(),
            0.1e-3);  // twice as much is what the parameters leave uncertain of the ends
}

TEST(Extrapolation,
     AJointWhoseEndsLeaveNothingToIdentifyFromIsTrustedNoMoreThanTheWorstOfTheOthers) {
  const auto cell = test::cell_7();
  // Joint 1 stood at either end of its range: without one of them half of the poses are left,
  // otherwise two thirds.
  MeasurementBatch batch;
  for (const bool upper : {false, true}) {
    JointRanges box = small_box();
    (upper ? box[0].first : box[0].second) = from_deg(upper ? 14 : -14);
    for (const Measurement& m :
         test::measured_within(test::chapter_5_robot(cell), box, 45, upper ? 12 : 13).measurements)
      batch.measurements.push_back(m);
  }
  CalibrationResult found = as_it_is(identified(cell, "M1", batch));
  const BiasModel bias = learned(found, batch, "se + joint_map");
  // Where the base is: as if two fifths of these poses had told it.
  found.covariance(0, 0) =
      std::pow(std::hypot(cell->tracker.sigma, found.discrepancy), 2) / (0.4 * 90);
  const LeftOut poses(found, batch);
  std::vector<Eigen::Index> half(45), third(30);
  std::iota(half.begin(), half.end(), 0);
  std::iota(third.begin(), third.end(), 0);
  ASSERT_FALSE(poses.without(half));
  ASSERT_TRUE(poses.without(third));
  for (const JointVector& slope :
       {slope_of(found, batch), extrapolation_slope(poses, cell->robot, bias)}) {
    EXPECT_GT(slope.tail(5).maxCoeff(), 0.1e-3);
    EXPECT_EQ(slope(0), slope.tail(5).maxCoeff());
  }
}

TEST(Extrapolation, IsOfTheJointThatThePhysicsLacks) {
  const auto cell = test::cell_7();
  MeasurementBatch batch = test::measured_within(test::chapter_5_robot(cell), small_box(), 300, 7);
  const CalibrationResult found = identified(cell, "M3", batch);
  const JointVector complete = slope_of(found, batch);
  // Something that grows with joint 4 across the arm: its slope from 20 to 30 deg is 1.7 mm/rad.
  for (Measurement& m : batch.measurements)
    m.p_W.x() += 2e-3 * m.context.q(3) * std::abs(m.context.q(3));
  const JointVector lacking = slope_of(as_it_is(found), batch);
  for (int j = 0; j < 6; ++j) {
    EXPECT_LT(complete(j), 0.15e-3) << j;
    EXPECT_LE(lacking(j), j == 3 ? 3e-3 : 0.6 * lacking(3)) << j;  // what joint 4 did there
  }
  EXPECT_GT(lacking(3), 1e-3);
}

TEST(Extrapolation, ToFirstOrderIsWhatIdentifyingAnewFinds) {
  const auto cell = test::cell_7();
  const MeasurementBatch batch =
      test::measured_within(test::chapter_5_robot(cell), small_box(), 200, 10);
  const CalibrationResult found = identified(cell, "M2", batch);
  MeasurementBatch rest = batch;
  const auto upper = [](const Measurement& m) { return m.context.q(1) > from_deg(5); };
  std::erase_if(rest.measurements, upper);
  const CalibrationResult anew = identified(cell, "M2", rest);
  double square = 0;
  double distance = 0;
  for (const Measurement& m : batch.measurements) {
    if (!upper(m)) continue;
    square += (m.p_W - anew.model.pose_W(m.context).translation()).squaredNorm() / 3;
    distance += std::pow(m.context.q(1) - from_deg(5), 2);
  }
  EXPECT_NEAR(slope_of(found, batch)(1), std::sqrt(square / distance),
              0.35 * std::sqrt(square / distance));
}

TEST(Extrapolation, ASuspectIsNotAsked) {
  const auto cell = test::cell_7();
  MeasurementBatch batch = test::measured_within(test::chapter_5_robot(cell), small_box(), 60, 8);
  CalibrationResult found = as_it_is(identified(cell, "M3", batch));
  const JointVector clean = slope_of(found, batch);
  Measurement& bad = batch.measurements[5];
  bad.p_W.x() += 0.05;
  EXPECT_GT(slope_of(found, batch).maxCoeff(), 10 * clean.maxCoeff());
  found.suspects = {{bad.pose_id, bad.row, 0.05, 1000}};
  EXPECT_LT(slope_of(found, batch).maxCoeff(), 2 * clean.maxCoeff());
}

TEST(Extrapolation, AJointThatStoodStillIsTrustedNoMoreThanTheWorstOfTheOthers) {
  const auto cell = test::cell_7();
  JointRanges box = small_box();
  box[5] = {0.3, 0.3};
  const MeasurementBatch batch = test::measured_within(test::chapter_5_robot(cell), box, 100, 9);
  const JointVector slope = slope_of(identified(cell, "M1", batch), batch);
  EXPECT_GT(slope.maxCoeff(), 0.5e-3);
  EXPECT_EQ(slope(5), slope.head(5).maxCoeff());
  // A model without parameters has nothing to identify anew, but what it lacks grows all the same.
  EXPECT_GT(slope_of(identified(cell, "M0", batch), batch).head(3).minCoeff(), 1e-3);
}

TEST(Extrapolation, GrowsWithTheChordAndStaysAtItsLargestBeyondHalfATurn) {
  Joint joint;
  EXPECT_NEAR(distance_beyond(joint, 0.01), 0.01, 1e-6);
  EXPECT_NEAR(distance_beyond(joint, from_deg(180)), 2, 1e-12);
  EXPECT_EQ(distance_beyond(joint, from_deg(300)), distance_beyond(joint, from_deg(180)));
  joint.type = JointType::kPrismatic;
  EXPECT_EQ(distance_beyond(joint, 7.5), 7.5);
}

}  // namespace
}  // namespace trammel
