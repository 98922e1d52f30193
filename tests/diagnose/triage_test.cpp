#include "server/diagnose/triage.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "server/measurement/checked_batch.h"
#include "server/tasks/train/train.h"
#include "tests/support/demand.h"
#include "tests/support/virtual_robot.h"

namespace trammel {
namespace {

/// The shipped cell with a model in force, and what its robot would measure after something
/// happened to it.
class TriageTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    TrainOptions options;
    options.bias = "none";
    const auto cell = test::cell_7();
    const auto batch = test::demand(check_against_cell(
        test::measured(test::chapter_5_robot(cell), 150, 1), *cell, drawn(0.2, 1)));
    model_ = std::make_unique<CompensatedModel>(test::demand(train(cell, batch, options)));
  }
  static void TearDownTestSuite() { model_.reset(); }

  static MeasurementBatch batch_of(const VirtualRobot& robot, std::uint64_t seed = 20,
                                   int poses = 90) {
    return test::demand(check_against_cell(test::measured(robot, poses, seed), *robot.truth.cell))
        .rows();
  }
  /// The robot with an error source more, whose parameters are `values`.
  static VirtualRobot robot_with(const std::string& spec, const std::vector<double>& values) {
    VirtualRobot robot = robot_as_it_was();
    const Eigen::Index at =
        add_source(robot.truth, test::demand(make_error_source(spec, *robot.truth.cell)));
    for (std::size_t k = 0; k < values.size(); ++k)
      robot.truth.values(at + static_cast<Eigen::Index>(k)) = values[k];
    return robot;
  }
  static VirtualRobot robot_as_it_was() { return test::chapter_5_robot(test::cell_7()); }
  static Triage triaged(const MeasurementBatch& batch) {
    return triage(*model_, test::demand(check_against_cell(batch, model_->cell())));
  }
  static bool could_be(const Triage& triage, const std::string& cause) {
    return triage.cause.cause == cause ||
           std::any_of(triage.could_also_be.begin(), triage.could_also_be.end(),
                       [&](const Cause& other) { return other.cause == cause; });
  }

  static std::unique_ptr<CompensatedModel> model_;
};
std::unique_ptr<CompensatedModel> TriageTest::model_;

TEST_F(TriageTest, ABatchOfTheSameRobotIsClean) {
  for (std::uint64_t seed = 20; seed < 30; ++seed) {
    const Triage clean = triaged(batch_of(robot_as_it_was(), seed));
    EXPECT_EQ(clean.verdict, TriageVerdict::kClean) << seed << ": " << clean.sentence;
    EXPECT_TRUE(clean.learn);
  }
}

TEST_F(TriageTest, ATrackerSetUpElsewhereIsHarmlessHoweverFar) {
  for (const double metres : {0.0005, 1.0}) {
    MeasurementBatch batch = batch_of(robot_as_it_was());
    // Trackers are levelled: gravity stays where it was.
    const Pose X = Eigen::Translation3d(metres, -metres, 0.3 * metres) *
                   Eigen::AngleAxisd(metres, Vector3::UnitZ());
    for (Measurement& m : batch.measurements) {
      m.p_W = X * m.p_W;
      m.R_WT = X.linear() * *m.R_WT;
    }
    const Triage moved = triaged(batch);
    EXPECT_EQ(moved.cause.cause, "tracker_moved") << moved.sentence;
    EXPECT_TRUE(moved.cause.pose_id.empty());
    EXPECT_TRUE(moved.learn);
    EXPECT_LT(moved.misfit_after, 1.3);
    EXPECT_EQ(moved.sentence.find(" mm"), std::string::npos)
        << "two set-ups apart is no error: " << moved.sentence;
  }
}

TEST_F(TriageTest, AnotherToolIsToldAndKeptApart) {
  const Triage tool = triaged(batch_of(robot_with("tool", {2e-3, -1e-3, 3e-3})));
  EXPECT_EQ(tool.cause.cause, "tool_changed") << tool.sentence;
  EXPECT_FALSE(tool.learn);
}

TEST_F(TriageTest, AnotherToolWhileTheTrackerStandsElsewhereIsToldAsBoth) {
  MeasurementBatch batch = batch_of(robot_with("tool", {2e-3, -1e-3, 3e-3}));
  for (Measurement& m : batch.measurements) m.p_W += Vector3(0.4, 0.2, -0.1);
  const Triage tool = triaged(batch);
  EXPECT_EQ(tool.cause.cause, "tool_changed") << tool.sentence;
  EXPECT_TRUE(tool.tracker_elsewhere);
  EXPECT_FALSE(tool.learn);
  // sqrt(14) mm, of which the set-up took a part: how far the tracker moved is not in it.
  EXPECT_GT(tool.effect_rms, 1e-3) << tool.sentence;
  EXPECT_LT(tool.effect_rms, 4e-3) << tool.sentence;
}

TEST_F(TriageTest, AnotherPayloadIsToldAndKeptApart) {
  const Triage payload = triaged(batch_of(robot_with("payload", {-60, 0, 0, 0})));
  EXPECT_TRUE(could_be(payload, "payload_changed")) << payload.sentence;
  EXPECT_FALSE(payload.learn);
}

TEST_F(TriageTest, AJointThatLostItsZeroIsTold) {
  for (int joint = 2; joint <= 5; ++joint) {
    const Triage slip =
        triaged(batch_of(robot_with(fmt::format("joint_slip:{}@1", joint), {1e-3})));
    EXPECT_EQ(slip.cause.cause, "joint_slip") << joint << ": " << slip.sentence;
    EXPECT_EQ(slip.cause.joint, joint - 1);
    EXPECT_TRUE(slip.cause.pose_id.empty());
  }
}

TEST_F(TriageTest, ATurnedBaseAndASlippedFirstJointAreNotToldApart) {
  const Triage slip = triaged(batch_of(robot_with("joint_slip:1@1", {1e-3})));
  EXPECT_TRUE(could_be(slip, "joint_slip")) << slip.sentence;
  const Triage turned = triaged(batch_of(robot_with("joint_slip:1@1", {1e-3}), 21, 400));
  EXPECT_TRUE(could_be(turned, "joint_slip")) << turned.sentence;
  EXPECT_TRUE(slip.learn);
}

TEST_F(TriageTest, OneBadPoseIsNamedAndTheBatchLearnedFrom) {
  MeasurementBatch batch = batch_of(robot_as_it_was());
  batch.measurements[40].p_W += Vector3(2e-3, 0, 0);
  const Triage bad = triaged(batch);
  EXPECT_EQ(bad.cause.cause, "outlier") << bad.sentence;
  EXPECT_EQ(bad.outliers, std::vector<std::string>{batch.measurements[40].pose_id});
  EXPECT_TRUE(bad.learn);
}

TEST_F(TriageTest, ATrackerThatMovedInTheMiddleIsDatedAndTheBatchKeptApart) {
  MeasurementBatch batch = batch_of(robot_as_it_was());
  for (std::size_t i = 57; i < batch.measurements.size(); ++i)
    batch.measurements[i].p_W += Vector3(3e-4, 2e-4, -4e-4);
  const Triage moved = triaged(batch);
  EXPECT_EQ(moved.cause.cause, "tracker_moved") << moved.sentence;
  EXPECT_EQ(moved.cause.pose_id, batch.measurements[57].pose_id);
  EXPECT_FALSE(moved.learn);
}

TEST_F(TriageTest, AnArmThatWearsIsDriftAndLearnedFrom) {
  VirtualRobot worn = robot_as_it_was();
  const std::vector<Parameter> parameters = worn.truth.parameters();
  for (std::size_t k = 0; k < parameters.size(); ++k) {
    auto& value = worn.truth.values(static_cast<Eigen::Index>(k));
    if (parameters[k].name == "C2" || parameters[k].name == "C3") value += 1e-6;
    if (parameters[k].name == "q3" || parameters[k].name == "q5") value += 8e-4;
  }
  const Triage drift = triaged(batch_of(worn));
  EXPECT_EQ(drift.cause.cause, "drift") << drift.sentence;
  EXPECT_TRUE(drift.learn);
}

TEST_F(TriageTest, WhatNothingExplainsIsPoisoned) {
  MeasurementBatch batch = batch_of(robot_as_it_was());
  std::mt19937_64 random(5);
  std::normal_distribution<double> noise(0, 1e-3);
  for (Measurement& m : batch.measurements)
    m.p_W += Vector3(noise(random), noise(random), noise(random));
  const Triage poisoned = triaged(batch);
  EXPECT_EQ(poisoned.verdict, TriageVerdict::kPoisoned) << poisoned.sentence;
  EXPECT_FALSE(poisoned.learn);
}

TEST_F(TriageTest, ABatchOfWhichNoPoseFitsIsAsManyDeviationsOffAsItIs) {
  MeasurementBatch batch = batch_of(robot_as_it_was());
  double way = 1;
  for (Measurement& m : batch.measurements) m.p_W += Vector3(2e-3 * (way = -way), 0, 0);
  const Triage poisoned = triaged(batch);
  ASSERT_EQ(poisoned.verdict, TriageVerdict::kPoisoned) << poisoned.sentence;
  EXPECT_NEAR(poisoned.effect_rms, 2e-3, 2e-4);
  EXPECT_GT(poisoned.misfit, 20) << poisoned.sentence;
  EXPECT_EQ(poisoned.sentence.find("(0 times"), std::string::npos) << poisoned.sentence;
}

/// What is read where the file has (x, y, z, w) under `qw, qx, qy, qz`.
void put_in_xyzw_order(Measurement& m) {
  const Eigen::Quaterniond q(*m.R_WT);
  m.R_WT = Eigen::Quaterniond(q.x(), q.y(), q.z(), q.w()).toRotationMatrix();
}

TEST_F(TriageTest, OrientationsInXyzwOrderAreKeptApartWithTheQuestion) {
  for (const std::size_t every : {1u, 3u}) {
    MeasurementBatch batch = batch_of(robot_as_it_was());
    for (std::size_t i = 0; i < batch.measurements.size(); i += every)
      put_in_xyzw_order(batch.measurements[i]);
    const Triage poisoned = triaged(batch);
    EXPECT_EQ(poisoned.verdict, TriageVerdict::kPoisoned) << poisoned.sentence;
    EXPECT_FALSE(poisoned.learn);
    EXPECT_NE(poisoned.sentence.find("read as xyzw they would fit to 0."), std::string::npos)
        << poisoned.sentence;
    EXPECT_NE(poisoned.sentence.find("xyzw order?"), std::string::npos) << poisoned.sentence;
  }
}

TEST_F(TriageTest, AToolTurnedAboutItsOwnPointShowsInTheOrientations) {
  for (const double angle : {5e-4, 0.02}) {
    MeasurementBatch batch = batch_of(robot_as_it_was());
    for (Measurement& m : batch.measurements) m.R_WT = *m.R_WT * rotation_exp({0, angle, 0});
    const Triage turned = triaged(batch);
    EXPECT_EQ(turned.cause.cause, "tool_changed") << turned.sentence;
    EXPECT_FALSE(turned.learn);
    EXPECT_NEAR(turned.effect_rotation_rms, angle, 0.1 * angle) << turned.sentence;
    EXPECT_LT(turned.effect_rms, 2e-4);
  }
}

TEST_F(TriageTest, OrientationsThatScatterFarMoreThanTheModelExpectsArePoison) {
  MeasurementBatch batch = batch_of(robot_as_it_was());
  std::mt19937_64 random(6);
  std::normal_distribution<double> noise(0, 1e-3);
  for (Measurement& m : batch.measurements)
    m.R_WT = rotation_exp({noise(random), noise(random), noise(random)}) * *m.R_WT;
  const Triage poisoned = triaged(batch);
  EXPECT_EQ(poisoned.verdict, TriageVerdict::kPoisoned) << poisoned.sentence;
  EXPECT_NE(poisoned.sentence.find("deg rms off the model"), std::string::npos)
      << poisoned.sentence;
}

TEST_F(TriageTest, OneBadOrientationIsNamedAndTheBatchLearnedFrom) {
  MeasurementBatch batch = batch_of(robot_as_it_was());
  batch.measurements[40].R_WT = *batch.measurements[40].R_WT * rotation_exp({0.01, 0, 0});
  const Triage bad = triaged(batch);
  EXPECT_EQ(bad.cause.cause, "outlier") << bad.sentence;
  EXPECT_EQ(bad.outliers, std::vector<std::string>{batch.measurements[40].pose_id});
  EXPECT_TRUE(bad.learn);
}

TEST_F(TriageTest, TooFewPosesAreNotJudged) {
  MeasurementBatch batch = batch_of(robot_with("tool", {5e-3, 0, 0}));
  batch.measurements.resize(5);
  EXPECT_EQ(triaged(batch).verdict, TriageVerdict::kClean);
}

}  // namespace
}  // namespace trammel
