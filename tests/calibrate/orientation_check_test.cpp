#include "server/calibrate/orientation_check.h"

#include <gtest/gtest.h>

#include <random>

#include "server/base/units.h"
#include "server/measurement/checked_batch.h"
#include "tests/support/demand.h"
#include "tests/support/virtual_robot.h"

namespace trammel {
namespace {

using Quaternion = Eigen::Quaterniond;
using Change = Matrix3 (*)(const Matrix3&);

/// The rotation that is read where the file has (x, y, z, w) under `qw, qx, qy, qz`.
Matrix3 in_xyzw_order(const Matrix3& R) {
  const Quaternion q(R);
  return Quaternion(q.x(), q.y(), q.z(), q.w()).toRotationMatrix();
}
Matrix3 inverse(const Matrix3& R) { return R.transpose(); }
Matrix3 inverse_in_xyzw_order(const Matrix3& R) { return in_xyzw_order(R.transpose()); }

void change(MeasurementBatch& batch, Change change, std::size_t every = 1) {
  for (std::size_t i = 0; i < batch.measurements.size(); i += every)
    batch.measurements[i].R_WT = change(*batch.measurements[i].R_WT);
}

MeasurementBatch measured(const std::shared_ptr<const Cell>& cell, int poses, std::uint64_t seed) {
  return test::demand(
             check_against_cell(test::measured(test::chapter_5_robot(test::cell_7()), poses, seed),
                                *cell))
      .rows();
}

/// Poses, each turned by up to `range` about a middle one.
MeasurementBatch within(double range, int poses, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> share(-range, range);
  Eigen::MatrixXd q(poses, 6);
  for (Eigen::Index i = 0; i < q.rows(); ++i) {
    q.row(i) << 0.3, 0.2, -0.1, 0.4, 0.9, 0.2;
    for (double& value : q.row(i).reshaped()) value += share(random);
  }
  SimulateOptions options;
  options.seed = seed;
  const auto cell = test::cell_7();
  MeasurementBatch batch = test::demand(simulate(test::chapter_5_robot(cell), q, options));
  return test::demand(check_against_cell(batch, *cell)).rows();
}

/// The tool of the cell unknown, or its base, or both.
std::vector<std::shared_ptr<const Cell>> cells() {
  std::vector<std::shared_ptr<const Cell>> all;
  for (const bool base : {true, false}) {
    for (const bool tool : {true, false}) {
      auto cell = std::make_shared<Cell>(*test::cell_7());
      if (!base) cell->X_WB.reset();
      if (!tool) cell->tools["spindle"].reset();
      all.push_back(cell);
    }
  }
  return all;
}

std::string said(const std::optional<Error>& doubt) { return doubt ? sentence(*doubt) : "nothing"; }

TEST(OrientationCheck, OrientationsOfTheJointsAreNotDoubted) {
  for (const auto& cell : cells()) {
    for (const int poses : {3, 5, 12, 150}) {
      const auto doubt = orientation_doubt(measured(cell, poses, 3), *cell);
      EXPECT_FALSE(doubt) << poses << ": " << said(doubt);
    }
  }
  for (const double range : {0.5, 0.1, 0.02, 0.002}) {
    const auto doubt = orientation_doubt(within(range, 60, 5), *test::cell_7());
    EXPECT_FALSE(doubt) << range << ": " << said(doubt);
  }
}

TEST(OrientationCheck, OrientationsOfAnotherOrderAreRefusedWithTheFigureOfTheReadingThatFits) {
  const std::pair<Change, const char*> kinds[] = {
      {in_xyzw_order, "as xyzw"},
      {inverse, "as the inverse"},
      {inverse_in_xyzw_order, "as xyzw and the inverse"}};
  for (const auto& cell : cells()) {
    for (const auto& [kind, reading] : kinds) {
      for (const int poses : {12, 150}) {
        MeasurementBatch batch = measured(cell, poses, 4);
        change(batch, kind);
        const Status status = check_orientations(batch, *cell);
        ASSERT_FALSE(status) << poses << ": " << reading;
        const Error& error = status.error();
        EXPECT_EQ(error.code, ErrorCode::kRefused);
        EXPECT_EQ(error.file, "batch " + batch.id);
        EXPECT_EQ(error.field, "qw,qx,qy,qz");
        EXPECT_EQ(error.text, reading) << sentence(error);
        EXPECT_GT(error.value, error.limit);
        EXPECT_FALSE(error.next.empty());
      }
    }
  }
}

TEST(OrientationCheck, OfPosesThatHardlyTurnTheOrderIsToldByTheToolOrByTheScatter) {
  for (const double range : {0.5, 0.1, 0.05, 0.01, 0.001}) {
    MeasurementBatch batch = within(range, 60, 6);
    change(batch, in_xyzw_order);
    const auto by_tool = orientation_doubt(batch, *test::cell_7());
    ASSERT_TRUE(by_tool) << range;
    EXPECT_EQ(by_tool->text, "as xyzw") << said(by_tool);
    auto unknown = std::make_shared<Cell>(*test::cell_7());
    unknown->tools["spindle"].reset();
    const auto by_scatter = orientation_doubt(batch, *unknown);
    ASSERT_EQ(by_scatter.has_value(), range > 0.005) << range << said(by_scatter);
    if (by_scatter) {
      EXPECT_EQ(by_scatter->text, "as xyzw") << said(by_scatter);
    }
  }
}

TEST(OrientationCheck, SomeRowsOfAnotherOrderAreCountedAndTheFirstIsNamed) {
  for (const auto& cell : cells()) {
    for (const std::size_t every : {2u, 3u, 10u}) {
      MeasurementBatch batch = measured(cell, 120, 7);
      batch.measurements.erase(batch.measurements.begin());
      std::rotate(batch.measurements.begin(), batch.measurements.begin() + 1,
                  batch.measurements.end());
      change(batch, in_xyzw_order, every);
      const auto doubt = orientation_doubt(batch, *cell);
      ASSERT_TRUE(doubt) << every;
      EXPECT_EQ(doubt->row, batch.measurements.front().row) << said(doubt);
      EXPECT_EQ(doubt->text, "as xyzw") << said(doubt);
    }
  }
}

TEST(OrientationCheck, OrientationsThatAreTheSameInAllRowsWereNotMeasured) {
  const auto cell = test::cell_7();
  MeasurementBatch batch = measured(cell, 40, 3);
  for (Measurement& m : batch.measurements) m.R_WT = Matrix3::Identity();
  const auto doubt = orientation_doubt(batch, *cell);
  ASSERT_TRUE(doubt);
  EXPECT_EQ(doubt->text, "the same in all rows") << sentence(*doubt);
}

TEST(OrientationCheck, OneWrongOrientationIsNamed) {
  MeasurementBatch batch = measured(test::cell_7(), 80, 8);
  batch.measurements[30].R_WT = *batch.measurements[30].R_WT * rotation_exp({0, 0.5, 0});
  const auto doubt = orientation_doubt(batch, *test::cell_7());
  ASSERT_TRUE(doubt);
  EXPECT_EQ(doubt->row, batch.measurements[30].row) << said(doubt);
  EXPECT_EQ(doubt->text, "pose " + batch.measurements[30].pose_id) << said(doubt);
  EXPECT_NEAR(doubt->value.value_or(0), to_deg(0.5), 0.5) << said(doubt);
}

TEST(OrientationCheck, AnotherToolFrameIsAskedForWithItsQuaternion) {
  MeasurementBatch batch = measured(test::cell_7(), 80, 9);
  const Matrix3 R_TS = rotation_exp({0, 0, from_deg(30)});
  for (Measurement& m : batch.measurements) m.R_WT = *m.R_WT * R_TS;
  const auto doubt = orientation_doubt(batch, *test::cell_7());
  ASSERT_TRUE(doubt);
  EXPECT_EQ(doubt->text, "against tool 'spindle'") << said(doubt);
  EXPECT_NEAR(doubt->value.value_or(0), 30, 0.5) << said(doubt);
  auto unknown = std::make_shared<Cell>(*test::cell_7());
  unknown->tools["spindle"].reset();
  EXPECT_FALSE(orientation_doubt(batch, *unknown)) << "the data may say how the tool is turned";
}

TEST(OrientationCheck, ATrackerSetUpElsewhereIsNoReasonForDoubt) {
  MeasurementBatch batch = measured(test::cell_7(), 80, 10);
  const Pose X = Eigen::Translation3d(0.5, -2, 0.3) * Eigen::AngleAxisd(1.2, Vector3::UnitZ());
  for (Measurement& m : batch.measurements) {
    m.p_W = X * m.p_W;
    m.R_WT = X.linear() * *m.R_WT;
  }
  EXPECT_FALSE(orientation_doubt(batch, *test::cell_7()));
  // Orientations in the robot's frame do not belong to positions in the tracker's.
  for (Measurement& m : batch.measurements) m.R_WT = X.linear().transpose() * *m.R_WT;
  const auto doubt = orientation_doubt(batch, *test::cell_7());
  ASSERT_TRUE(doubt);
  EXPECT_EQ(doubt->text, "against the robot's base instead of the tracker") << said(doubt);
}

TEST(OrientationCheck, FewPosesOfAnUnknownToolAreNotDoubtedBecauseTheTrackerStandsElsewhere) {
  const Pose X = Eigen::Translation3d(0.4, -0.3, 0.2) * Eigen::AngleAxisd(-0.3, Vector3::UnitZ());
  auto cell = std::make_shared<Cell>(*test::cell_7());
  cell->tools["spindle"].reset();
  for (const int poses : {3, 4, 5}) {
    MeasurementBatch batch = measured(test::cell_7(), poses, 14);
    for (Measurement& m : batch.measurements) {
      m.p_W = X * m.p_W;
      m.R_WT = X.linear() * *m.R_WT;
    }
    const auto doubt = orientation_doubt(batch, *cell);
    EXPECT_FALSE(doubt) << poses << ": " << said(doubt);
    if (poses == 3) continue;  // of two turns both orders have the angles
    change(batch, in_xyzw_order);
    EXPECT_TRUE(orientation_doubt(batch, *cell)) << poses;
  }
}

TEST(OrientationCheck, OrientationsAgainstTheRobotsBaseAreToldFromThoseAgainstTheTracker) {
  MeasurementBatch batch = measured(test::cell_7(), 80, 11);
  const Matrix3 R = rotation_exp({0, 0, 0.8});
  for (Measurement& m : batch.measurements) m.p_W = R * m.p_W;
  auto cell = std::make_shared<Cell>(*test::cell_7());
  cell->X_WB = make_pose(R, Vector3::Zero());
  const auto doubt = orientation_doubt(batch, *cell);
  ASSERT_TRUE(doubt);
  EXPECT_EQ(doubt->text, "against the robot's base instead of the tracker") << said(doubt);
}

TEST(OrientationCheck, AJointThatPositionsHardlyShowIsSuspectedToo) {
  auto cell = std::make_shared<Cell>(*test::cell_7());
  cell->tools["spindle"]->translation() = Vector3(0, 0, 0.15);
  VirtualRobot robot = test::chapter_5_robot(cell);
  MeasurementBatch batch =
      test::demand(check_against_cell(test::measured(robot, 80, 12), *cell)).rows();
  for (Measurement& m : batch.measurements) m.context.q(5) = -m.context.q(5);
  const auto doubt = orientation_doubt(batch, *cell);
  ASSERT_TRUE(doubt);
  EXPECT_EQ(doubt->text, "with the other sign of q6_deg") << said(doubt);
}

TEST(OrientationCheck, JointsThatLeadElsewhereAreLeftToThePositions) {
  MeasurementBatch batch = measured(test::cell_7(), 80, 13);
  for (Measurement& m : batch.measurements) m.context.q(2) = -m.context.q(2) / 2;
  EXPECT_FALSE(orientation_doubt(batch, *test::cell_7()));
}

}  // namespace
}  // namespace trammel
