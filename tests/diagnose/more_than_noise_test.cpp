#include "server/diagnose/tell/more_than_noise.h"

#include <gtest/gtest.h>

#include <random>

#include "server/diagnose/diagnose.h"
#include "server/robot/arm_state.h"
#include "tests/support/demand.h"
#include "tests/support/virtual_robot.h"

namespace trammel::cause_search {
namespace {

/// cell-7's virtual robot, whose errors are those of the cell's error sources, with noise so many
/// times as stated.
MeasurementBatch with_noise(double times, double times_rotation, std::uint64_t seed,
                            int poses = 120) {
  MeasurementBatch batch = test::measured(test::chapter_5_robot(test::cell_7()), poses, seed);
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  const auto vector = [&] { return Vector3(normal(random), normal(random), normal(random)); };
  const Tracker& tracker = test::cell_7()->tracker;
  for (Measurement& m : batch.measurements) {
    m.p_W += tracker.sigma * std::sqrt(times * times - 1) * vector();
    m.R_WT = rotation_exp(tracker.sigma_rotation * std::sqrt(times_rotation * times_rotation - 1) *
                          vector()) *
             *m.R_WT;
  }
  return batch;
}

Diagnosis diagnosed(const MeasurementBatch& batch) {
  DiagnoseOptions options;
  options.recovery = false;
  return test::demand(diagnose(test::cell_7(), batch, options));
}

TEST(MoreThanNoise, NoiseAsStatedIsNothing) {
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const Diagnosis clean = diagnosed(with_noise(1, 1, seed));
    EXPECT_EQ(clean.verdict, Verdict::kNothing) << clean.sentence;
    EXPECT_FALSE(clean.unexplained.present);
  }
}

TEST(MoreThanNoise, NoiseFarBeyondWhatWasStatedIsUnknownWithBothFigures) {
  for (const double times : {1.6, 3.0, 30.0}) {
    const Diagnosis noisy = diagnosed(with_noise(times, 1, 4));
    EXPECT_EQ(noisy.verdict, Verdict::kUnknown) << noisy.sentence;
    EXPECT_TRUE(noisy.unexplained.present);
    EXPECT_TRUE(noisy.unexplained.depends_on.empty());
    EXPECT_LT(noisy.unexplained.p_value, 1e-3);
    EXPECT_NEAR(noisy.left_position.left / noisy.left_position.stated, times, 0.1 * times);
    EXPECT_NE(noisy.sentence.find("More than noise"), std::string::npos) << noisy.sentence;
    EXPECT_NE(noisy.sentence.find("times the stated noise in position"), std::string::npos)
        << noisy.sentence;
    EXPECT_NE(noisy.sentence.find("Measure some poses repeatedly"), std::string::npos)
        << noisy.sentence;
    EXPECT_EQ(noisy.sentence.find("Nothing"), std::string::npos) << noisy.sentence;
  }
}

TEST(MoreThanNoise, OrientationsAreJudgedLikePositions) {
  const Diagnosis noisy = diagnosed(with_noise(1, 2.5, 5));
  EXPECT_EQ(noisy.verdict, Verdict::kUnknown) << noisy.sentence;
  EXPECT_NE(noisy.sentence.find("times the stated noise in orientation"), std::string::npos)
      << noisy.sentence;
}

TEST(MoreThanNoise, ATenthMoreIsANoteAndThreeTenthsAreUnknown) {
  for (const std::uint64_t seed : {6, 7, 8}) {
    const Diagnosis note = diagnosed(with_noise(1.12, 1, seed, 300));
    EXPECT_EQ(note.verdict, Verdict::kNothing) << note.sentence;
    EXPECT_TRUE(std::any_of(note.limits.begin(), note.limits.end(), [](const std::string& limit) {
      return limit.starts_with("a little more than noise");
    })) << note.left_position.left / note.left_position.stated;
    const Diagnosis more = diagnosed(with_noise(1.3, 1, seed, 300));
    EXPECT_EQ(more.verdict, Verdict::kUnknown)
        << more.left_position.left / more.left_position.stated;
    EXPECT_TRUE(more.unexplained.depends_on.empty()) << more.sentence;
    EXPECT_TRUE(more.findings.empty()) << more.sentence;
  }
}

TEST(MoreThanNoise, FewPosesMayScatterMoreByChance) {
  const LeftOver many{1.35 * 13e-6, 13e-6, 600};
  const LeftOver few{1.35 * 13e-6, 13e-6, 20};
  EXPECT_EQ(judge_noise(many), NoiseVerdict::kMoreThanNoise);
  EXPECT_EQ(judge_noise(few), NoiseVerdict::kAsStated);
  EXPECT_LT(chance_of_noise(many), 0.01) << "sigma itself is known to a tenth";
  EXPECT_GT(chance_of_noise(few), 0.04);
  EXPECT_EQ(judge_noise({}), NoiseVerdict::kAsStated);
}

TEST(MoreThanNoise, OrientationsInXyzwOrderAreRefused) {
  MeasurementBatch batch = with_noise(1, 1, 7);
  for (Measurement& m : batch.measurements) {
    const Eigen::Quaterniond q(*m.R_WT);
    m.R_WT = Eigen::Quaterniond(q.x(), q.y(), q.z(), q.w()).toRotationMatrix();
  }
  const auto refused = diagnose(test::cell_7(), batch, {});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().field, "qw,qx,qy,qz");
  EXPECT_EQ(refused.error().text, "as xyzw") << sentence(refused.error());
}

/// cell-7's virtual robot with play in joint 3 that grows with the torque on it more than the gear
/// gives way, every pose approached from below or from either side.
Diagnosis with_loaded_play(bool both_sides) {
  const auto cell = test::cell_7();
  VirtualRobot robot = test::chapter_5_robot(cell);
  MeasurementBatch batch = test::measured(robot, 120, 21);
  for (std::size_t i = 0; i < batch.measurements.size(); ++i) {
    Measurement& m = batch.measurements[i];
    const int side = both_sides && i % 2 == 0 ? -1 : 1;
    m.context.direction.assign(6, side);
    ArmState arm = robot.truth.state(m.context);
    const Pose still = ArmKinematics(arm).tool_pose_W();
    arm.add_to_joint(2, -side * (5e-5 + 1e-6 * std::abs(ArmKinematics(arm).gravity_torque()(2))));
    const Pose moved = ArmKinematics(arm).tool_pose_W() * still.inverse();
    m.p_W = moved * m.p_W;
    m.R_WT = moved.linear() * *m.R_WT;
  }
  return diagnosed(batch);
}

TEST(MoreThanNoise, PlayThatGrowsWithTheLoadIsPlayFromBothSidesAndNothingForSureFromOne) {
  const Diagnosis one_side = with_loaded_play(false);
  EXPECT_TRUE(one_side.unexplained.present) << one_side.sentence;
  for (const Finding& finding : one_side.findings)
    EXPECT_FALSE(finding.could_also_be.empty()) << one_side.sentence;
  const Diagnosis both = with_loaded_play(true);
  ASSERT_EQ(both.findings.size(), 1U) << both.sentence;
  EXPECT_EQ(both.findings.front().cause.cause, "backlash") << both.sentence;
  EXPECT_FALSE(both.unexplained.present) << both.sentence;
}

}  // namespace
}  // namespace trammel::cause_search
