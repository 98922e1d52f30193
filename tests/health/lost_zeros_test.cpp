// Arms whose lengths are written down here, not read by the project's kinematics: what a check says
// of their lost zeros.
#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "server/base/units.h"
#include "server/health/health_check.h"
#include "server/measurement/checked_batch.h"
#include "tests/support/demand.h"
#include "tests/support/plain_arm.h"

namespace trammel {
namespace {

using test::elbows;
using test::measured;
using test::PlainArm;
using test::PlainCheck;

Result<HealthCheck> checked(const CompensatedModel& model, const MeasurementBatch& batch) {
  return check_health(model, test::demand(check_against_cell(batch, model.cell(), drawn(0, 1))),
                      {});
}

bool is_zero_of(const SingleCause& cause, int joint) {
  return cause.record->spelling == "joint_slip" && cause.joint + 1 == joint;
}

/// Named first, or beside it.
bool names_zero_of(const HealthCheck& check, int joint) {
  if (check.changed.empty()) return false;
  const SeenChange& first = check.changed.front();
  const auto is = [&](const SingleCause& cause) { return is_zero_of(cause, joint); };
  return std::any_of(first.zeros.begin(), first.zeros.end(),
                     [&](const LostZero& zero) { return zero.joint + 1 == joint; }) ||
         std::any_of(first.could_also_be.begin(), first.could_also_be.end(), is);
}

/// One model for all tests of the arm with elbows.
const CompensatedModel& model_of_elbows() {
  static const CompensatedModel model = test::trained(test::iiwa());
  return model;
}

TEST(LostZerosOfElbows, AreNamedByPositionsAloneWhereTheInstrumentStandsAsInTheModel) {
  const PlainArm arm = test::iiwa();
  const std::vector<JointVector> poses = elbows(arm);
  for (int joint = 2; joint <= 6; ++joint) {
    const double by = from_deg(joint % 2 == 0 ? 1.0 : 0.1);
    const HealthCheck check = test::demand(checked(
        model_of_elbows(), measured(arm, {poses, by * JointVector::Unit(7, joint - 1), false})));
    EXPECT_EQ(check.verdict, HealthVerdict::kChanged) << joint << ": " << check.sentence;
    EXPECT_TRUE(names_zero_of(check, joint)) << joint << ": " << check.sentence;
    EXPECT_NE(check.sentence.find("turned as in the model"), std::string::npos) << check.sentence;
    ASSERT_FALSE(check.changed.empty()) << check.sentence;
    for (const LostZero& zero : check.changed.front().zeros) {
      if (zero.joint + 1 != joint) continue;
      EXPECT_NEAR(zero.by, by, 1.5 * zero.u95) << check.sentence;
    }
  }
}

TEST(LostZerosOfElbows, CannotBeToldByPositionsOfAnInstrumentThatWasMoved) {
  const PlainArm arm = test::iiwa();
  PlainCheck moved{elbows(arm), 2e-3 * JointVector::Unit(7, 3), false};
  moved.X_WB.translation() = Vector3(0.7, -0.4, 0.2);
  const HealthCheck check = test::demand(checked(model_of_elbows(), measured(arm, moved)));
  EXPECT_EQ(check.verdict, HealthVerdict::kCannotTell) << check.sentence;
  EXPECT_NE(check.sentence.find("spread"), std::string::npos) << check.sentence;
}

TEST(LostZerosOfSixPoses, AreNamedThoughTheFileWouldFitBetterReadOtherwise) {
  const std::vector<std::vector<double>> angles = {
      {1.3792, 0.0094, 0.3825, -0.7798, 0.5230, -2.0421},
      {2.2160, 0.6580, 0.6713, 0.7060, 0.6040, 1.9026},
      {2.2858, -0.3932, -0.8614, 1.1248, -0.0612, 2.3713},
      {0.2870, -1.2029, -1.4952, 1.1175, -0.5163, -1.0590},
      {0.8097, -0.7946, -0.6656, -0.5403, 0.9376, 1.0432},
      {1.9383, -0.6781, 0.8978, 0.1876, -0.4608, 2.0941}};
  PlainCheck few{{}, JointVector::Zero(6)};
  for (const auto& q : angles) few.poses.emplace_back(Eigen::Map<const JointVector>(q.data(), 6));
  few.zeros << 0, -0.03052, 0, -0.031006, 0.031806, 0;  // rad
  few.tool += Vector3(0.53e-3, 0.52e-3, 0.16e-3);
  const auto check = checked(test::trained(test::irb120()), measured(test::irb120(), few));
  ASSERT_TRUE(check) << check.error().message;
  ASSERT_FALSE(check->changed.empty()) << check->sentence;
  EXPECT_EQ(check->changed.front().zeros.size(), 3u) << check->sentence;
}

/// One model for all tests of the arm with six axes.
const CompensatedModel& model_of_six_axes() {
  static const CompensatedModel model = test::trained(test::irb120());
  return model;
}

/// All over the workspace.
std::vector<JointVector> spread_poses(int count, std::uint64_t seed) {
  constexpr double kWidest[] = {2.2, 1.1, 1.0, 2.2, 1.6, 2.5};  // rad
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> share(-1, 1);
  std::vector<JointVector> poses;
  for (int i = 0; i < count; ++i) {
    JointVector q(6);
    for (int j = 0; j < 6; ++j) q(j) = kWidest[j] * share(random);
    poses.push_back(q);
  }
  return poses;
}

TEST(LostZeroOfADegree, LeavesNothingThatAnotherCauseExplains) {
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    for (const int joint : {3, 4, 5}) {
      PlainCheck one{spread_poses(14, seed), from_deg(1) * JointVector::Unit(6, joint - 1), false};
      one.seed = seed;
      const HealthCheck check =
          test::demand(checked(model_of_six_axes(), measured(test::irb120(), one)));
      ASSERT_EQ(check.changed.size(), 1u) << check.sentence;
      EXPECT_TRUE(is_zero_of(check.changed.front().cause, joint)) << check.sentence;
      ASSERT_EQ(check.changed.front().zeros.size(), 1u) << check.sentence;
      EXPECT_EQ(check.sentence.find("several joints"), std::string::npos) << check.sentence;
      const LostZero& zero = check.changed.front().zeros.front();
      EXPECT_NEAR(zero.by, from_deg(1), 1.5 * zero.u95) << check.sentence;
    }
  }
}

TEST(LostZerosOfSeveralJoints, HaveEachTheMillimetresThatACheckOfThatOneAloneTells) {
  PlainCheck several{spread_poses(14, 5), JointVector::Zero(6)};
  several.zeros << 0, 2e-3, -1.5e-3, 0, 2.5e-3, 0;
  const HealthCheck all =
      test::demand(checked(model_of_six_axes(), measured(test::irb120(), several)));
  ASSERT_FALSE(all.changed.empty()) << all.sentence;
  ASSERT_EQ(all.changed.front().zeros.size(), 3u) << all.sentence;
  for (const LostZero& zero : all.changed.front().zeros) {
    PlainCheck one = several;
    one.zeros = several.zeros(zero.joint) * JointVector::Unit(6, zero.joint);
    const HealthCheck alone =
        test::demand(checked(model_of_six_axes(), measured(test::irb120(), one)));
    ASSERT_FALSE(alone.changed.empty()) << alone.sentence;
    EXPECT_NEAR(zero.effect_rms, alone.changed.front().effect_rms,
                zero.effect_u95 + alone.changed.front().u95)
        << all.sentence << alone.sentence;
    EXPECT_LT(zero.effect_u95, 0.05 * zero.effect_rms) << all.sentence;
  }
}

TEST(LostZerosOfSeveralJoints, AreNamedWhereTheToolLiesOnTheLastAxis) {
  const Vector3 on_axis(5e-5, 0, 0.18);
  CompensatedModel::Parts parts = test::trained(test::irb120(), on_axis).parts();
  // An arm that its model does not describe wholly, with some larger errors
  parts.discrepancy = 10e-6;  // m
  for (Evaluation* shown : {&parts.training, &*parts.validation})
    shown->compensated.p997 = 3 * shown->compensated.rms;
  const CompensatedModel model = test::demand(CompensatedModel::make(std::move(parts)));
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    PlainCheck check{spread_poses(12, seed), JointVector::Zero(6)};
    check.tool = on_axis;
    check.seed = seed;
    const HealthCheck healthy = test::demand(checked(model, measured(test::irb120(), check)));
    EXPECT_EQ(healthy.verdict, HealthVerdict::kHealthy) << healthy.sentence;
    check.zeros << 0, 1.3e-3, -1.9e-3, 1.8e-3, 1.7e-3, 0;
    const HealthCheck lost = test::demand(checked(model, measured(test::irb120(), check)));
    ASSERT_EQ(lost.changed.size(), 1u) << lost.sentence;
    EXPECT_EQ(lost.changed.front().zeros.size(), 4u) << lost.sentence;
  }
}

TEST(LostZeroOfTheLastJoint, StandsNotBesideAToolThatOrientationsShowNotToHaveTurned) {
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    PlainCheck knocked{spread_poses(14, seed), JointVector::Zero(6), true};
    knocked.seed = seed;
    knocked.tool += Vector3(0.8e-3, -0.4e-3, 0.5e-3);
    const HealthCheck check =
        test::demand(checked(model_of_six_axes(), measured(test::irb120(), knocked)));
    ASSERT_EQ(check.changed.size(), 1u) << check.sentence;
    EXPECT_EQ(check.changed.front().cause.record->spelling, "tool_changed") << check.sentence;
    EXPECT_TRUE(check.changed.front().could_also_be.empty()) << check.sentence;
    EXPECT_EQ(check.sentence.find("mark of joint 6"), std::string::npos) << check.sentence;
  }
}

TEST(LostZeroOfTheLastJoint, StandsBesideAToolThatMayHaveTurned) {
  for (const bool orientation : {false, true}) {
    for (const double zero : {0.0, 2e-4, 3e-3}) {
      PlainCheck knocked{spread_poses(14, 3), JointVector::Zero(6), orientation};
      knocked.tool += Vector3(0.8e-3, -0.4e-3, 0.5e-3);
      knocked.zeros(5) = zero;
      const HealthCheck check =
          test::demand(checked(model_of_six_axes(), measured(test::irb120(), knocked)));
      ASSERT_FALSE(check.changed.empty()) << check.sentence;
      const bool is_seen = zero > 5e-4;  // by orientations: 0.2 mrad do 9 um, a tenth of the
                                         // tolerance, and less than these poses show
      if (is_seen || !orientation) {
        EXPECT_TRUE(names_zero_of(check, 6)) << zero << orientation << ": " << check.sentence;
      }
      const bool is_told = std::any_of(
          check.changed.begin(), check.changed.end(),
          [](const SeenChange& change) { return change.cause.record->spelling == "tool_changed"; });
      EXPECT_TRUE(is_told) << zero << orientation << ": " << check.sentence;
      if (!orientation) {
        EXPECT_NE(check.sentence.find("look at the mark of joint 6"), std::string::npos)
            << check.sentence;
      }
    }
  }
}

TEST(LostZerosOfSeveralJoints, AreNamedBesideAPoseThatWasMeasuredWrongly) {
  for (const bool orientation : {false, true}) {
    PlainCheck several{spread_poses(14, 5), JointVector::Zero(6), orientation};
    several.zeros << 0, 2e-3, -1.5e-3, 0, 2.5e-3, 0;
    MeasurementBatch batch = measured(test::irb120(), several);
    Measurement& bad = batch.measurements[4];
    bad.p_W += Vector3(2e-3, -3e-3, 2.5e-3);
    const HealthCheck check = test::demand(checked(model_of_six_axes(), batch));
    EXPECT_EQ(check.suspects, std::vector<std::string>{bad.pose_id}) << check.sentence;
    ASSERT_FALSE(check.changed.empty()) << check.sentence;
    ASSERT_EQ(check.changed.front().zeros.size(), 3u) << check.sentence;
    for (const LostZero& zero : check.changed.front().zeros)
      EXPECT_NEAR(zero.by, several.zeros(zero.joint), 1.5 * zero.u95) << check.sentence;
  }
}

}  // namespace
}  // namespace trammel
