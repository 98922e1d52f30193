#include "server/health/health_check.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "server/base/units.h"
#include "server/measurement/files/batch_file.h"
#include "server/report/health_json.h"
#include "server/report/page_parts.h"
#include "server/tasks/train/train.h"
#include "tests/support/checked_robot.h"
#include "tests/support/demand.h"
#include "tests/support/remastered.h"
#include "tests/support/virtual_robot.h"

namespace trammel {
namespace {

using test::checked;
using test::CheckedRobot;
using test::joints_of;
using test::trained_robot;
using test::zero_off;

HealthOptions tolerance_mm(double mm) {
  HealthOptions options;
  options.tolerance = mm * from_mm(1);
  return options;
}

bool is_joint_slip(const SingleCause& cause, int joint) {
  return cause.record->spelling == "joint_slip" && cause.joint == joint;
}

/// One robot for all tests: trained on 200 poses, checked by twelve planned ones.
class HealthTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    robot_ = new CheckedRobot(trained_robot({.seed = 3, .poses = 200}));
  }
  static void TearDownTestSuite() {
    delete robot_;
    robot_ = nullptr;
  }
  [[nodiscard]] static hidden::Effect effect(const hidden::HiddenCause& cause, double mm,
                                             bool new_tool = false) {
    hidden::Random random(5);
    return changed_by(robot_->robot, cause, mm, new_tool, random);
  }
  static CheckedRobot* robot_;
};
CheckedRobot* HealthTest::robot_ = nullptr;

TEST_F(HealthTest, AHealthyRobotIsHealthyAndTheCheckSaysWhatItWouldHaveSeen) {
  int healthy = 0;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const HealthCheck check = checked(*robot_, {}, seed, tolerance_mm(0.05));
    EXPECT_NE(check.verdict, HealthVerdict::kChanged) << seed << ": " << check.sentence;
    healthy += check.verdict == HealthVerdict::kHealthy ? 1 : 0;
    ASSERT_TRUE(check.would_have_seen);
    EXPECT_LT(*check.would_have_seen, 50e-6);
    EXPECT_NEAR(check.rms, check.expected_rms, 0.4 * check.expected_rms);
  }
  EXPECT_GE(healthy, 9);
}

TEST_F(HealthTest, AJointThatLostItsZeroBy50umIsSeenAndNamedWithItsSize) {
  const hidden::Effect slip = effect({"joint_slip", 3, "", 0, {}, 0}, 0.05);
  int named = 0;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const HealthCheck check = checked(*robot_, {{slip}}, seed, tolerance_mm(0.1));
    ASSERT_EQ(check.verdict, HealthVerdict::kChanged) << seed << ": " << check.sentence;
    const SeenChange& change = check.changed.front();
    const auto is = [](const SingleCause& cause) { return is_joint_slip(cause, 2); };
    const bool listed = std::any_of(change.could_also_be.begin(), change.could_also_be.end(), is);
    named += is(change.cause) || listed ? 1 : 0;
    if (is(change.cause)) {
      EXPECT_NEAR(change.effect_rms, 50e-6, 2 * change.u95) << seed;
    }
  }
  EXPECT_GE(named, 9);
}

TEST_F(HealthTest, WhenTheNextCheckIsDueFollowsFromAllChecksThatWereMade) {
  constexpr std::int64_t kDay_s = 86400;
  constexpr std::int64_t kMeasured = 1'700'000'000;
  CompensatedModel::Parts parts = robot_->model.parts();
  parts.provenance.measured_at = kMeasured;
  CheckedRobot dated{robot_->robot, test::demand(CompensatedModel::make(std::move(parts))),
                     robot_->planned};
  HealthOptions options = tolerance_mm(0.1);
  HealthCheck check;
  std::vector<std::string> due;
  for (std::int64_t month = 1; month <= 4; ++month) {
    MeasurementBatch batch = measured_check(dated, {}, static_cast<std::uint64_t>(month));
    batch.measured_at = kMeasured + 30 * month * kDay_s;
    check = test::demand(check_health(
        dated.model, test::demand(check_against_cell(batch, dated.model.cell(), drawn(0, 1))),
        options));
    ASSERT_TRUE(check.drift && check.drift_rate) << check.due_because;
    EXPECT_EQ(check.drift_rate->checks, month);
    double squares = 0;
    for (const PoseAtCheck& pose : check.at_poses) squares += pose.off_B.squaredNorm();
    ASSERT_EQ(check.at_poses.size(), static_cast<std::size_t>(check.poses));
    EXPECT_NEAR(std::sqrt(squares / check.poses), check.rms, 1e-12) << "poses add up to the rms";
    EXPECT_EQ(check.due_because.find("until then every 30 days") != std::string::npos, month < 3)
        << "two checks are no rate: " << check.due_because;
    const std::string usual = shown_day(*batch.measured_at + kUsualInterval);
    EXPECT_TRUE(month >= 3 || check.due == usual) << check.due;
    const std::string text = health_json(check, {}).dump();
    const auto read = drift_of(text);
    ASSERT_TRUE(read) << text;
    options.earlier.push_back(*read);
    due.push_back(check.due);
  }
  EXPECT_GT(due.back(), due[2]);
  EXPECT_NE(check.due_because.find("by 4 checks over 120 days"), std::string::npos)
      << check.due_because;
  options.earlier.clear();
  MeasurementBatch batch = measured_check(dated, {}, 1);
  batch.measured_at = kMeasured + 30 * kDay_s;
  const HealthCheck alone = test::demand(check_health(
      dated.model, test::demand(check_against_cell(batch, dated.model.cell(), drawn(0, 1))),
      options));
  EXPECT_LT(check.drift_rate->most, alone.drift_rate->most);
  EXPECT_NE(alone.due_because.find("30 days before"), std::string::npos) << alone.due_because;
  EXPECT_NE(alone.due_because.find("needs 3 checks"), std::string::npos) << alone.due_because;
}

/// Poses of a check on a day of that temperature, of an arm that was trained at 24 degrees, not at
/// that of drawings.
HealthCheck checked_in_warmth(double temperature, double growth, std::uint64_t seed) {
  const auto cell = test::cell_7();
  const VirtualRobot robot = test::chapter_5_robot(cell);
  const auto as_batch = [&](double warmth, int poses, std::uint64_t at) {
    return test::demand(check_against_cell(
        test::measured(test::in_warmth(robot, warmth, growth), poses, at), *cell, drawn(0, 1)));
  };
  TrainOptions options;
  options.bias = "none";
  const CompensatedModel model = test::demand(train(cell, as_batch(24, 150, 1), options));
  return test::demand(check_health(model, as_batch(temperature, 14, seed), tolerance_mm(0.1)));
}

TEST(HealthOnAColdDay, AnArmThatHasShrunkSinceItsTrainingIsCalledColdAndNoLinkIsBlamed) {
  for (std::uint64_t seed = 11; seed <= 14; ++seed) {
    const HealthCheck check = checked_in_warmth(16, 11.5e-6, seed);
    ASSERT_EQ(check.verdict, HealthVerdict::kChanged) << check.sentence;
    EXPECT_EQ(check.changed.front().cause.record->spelling, "thermal_growth") << check.sentence;
    EXPECT_EQ(check.changed.size(), 1u) << check.sentence;
  }
}

TEST(HealthOnAColdDay, AnArmThatDoesNotGrowHasNotChanged) {
  for (std::uint64_t seed = 11; seed <= 14; ++seed) {
    const HealthCheck check = checked_in_warmth(16, 0, seed);
    EXPECT_NE(check.verdict, HealthVerdict::kChanged) << check.sentence;
  }
}

TEST_F(HealthTest, WhatThePosesCouldHideIsNotCalledHealthy) {
  const HealthCheck check = checked(*robot_, {}, 1, tolerance_mm(0.01));
  EXPECT_EQ(check.verdict, HealthVerdict::kCannotTell) << check.sentence;
}

TEST_F(HealthTest, ASingleBadPoseIsNamedAndIsNoChangeNorHealth) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const int bad = static_cast<int>(seed);
    const HealthCheck check =
        checked(*robot_, {{}, bad, seed % 2 == 0 ? 30.0 : 0.5}, seed, tolerance_mm(0.1));
    EXPECT_EQ(check.verdict, HealthVerdict::kCannotTell) << seed << ": " << check.sentence;
    ASSERT_EQ(check.suspects.size(), 1u) << check.sentence;
    EXPECT_EQ(check.suspects.front(), fmt::format("p{}", bad + 1));
    const auto& here = check.at_poses;
    const auto worst = std::max_element(
        here.begin(), here.end(),
        [](const auto& one, const auto& other) { return one.off_B.norm() < other.off_B.norm(); });
    ASSERT_NE(worst, here.end());
    EXPECT_EQ(worst->pose_id, check.suspects.front());
    EXPECT_TRUE(worst->suspect);
    EXPECT_EQ(std::count_if(here.begin(), here.end(), [](const auto& one) { return one.suspect; }),
              1);
  }
}

TEST_F(HealthTest, AToolThatWasMountedAnewIsNoChangeWhereThatIsSaid) {
  const hidden::Effect mounted = effect({"tool_changed", 0, "", 0, {}, 0}, 1.0);
  HealthOptions options = tolerance_mm(0.1);
  EXPECT_EQ(checked(*robot_, {{mounted}}, 1, options).verdict, HealthVerdict::kChanged);
  options.new_tool = true;
  const HealthCheck check = checked(*robot_, {{mounted}}, 1, options);
  EXPECT_EQ(check.verdict, HealthVerdict::kHealthy) << check.sentence;
  const hidden::Effect slip = effect({"joint_slip", 3, "", 0, {}, 0}, 0.06, true);
  EXPECT_EQ(checked(*robot_, {{mounted, slip}}, 1, options).verdict, HealthVerdict::kChanged);
}

TEST_F(HealthTest, TooFewPosesCannotTell) {
  CheckedRobot few = *robot_;
  few.planned.resize(2);
  const HealthCheck check = checked(few, {}, 1, tolerance_mm(0.1));
  EXPECT_EQ(check.verdict, HealthVerdict::kCannotTell);
  EXPECT_FALSE(check.would_have_seen);
}

TEST_F(HealthTest, PlannedPosesShowMoreThanScatteredOnes) {
  const HealthCheck planned = checked(*robot_, {}, 1, tolerance_mm(0.1));
  ASSERT_TRUE(planned.would_have_seen);
  constexpr std::size_t kDraws = 4;
  double by_chance = 0;
  for (std::size_t draw = 0; draw < kDraws; ++draw) {
    CheckedRobot scattered = *robot_;
    const std::size_t n = scattered.planned.size();
    for (std::size_t i = 0; i < n; ++i)
      scattered.planned[i] = scattered.robot.world.poses[draw * n + i].q;
    const HealthCheck check = checked(scattered, {}, 1, tolerance_mm(0.1));
    ASSERT_TRUE(check.would_have_seen);
    by_chance += *check.would_have_seen / kDraws;
  }
  EXPECT_LT(*planned.would_have_seen, 0.9 * by_chance);
}

TEST_F(HealthTest, ACheckIsOneSetUpOfTheInstrument) {
  MeasurementBatch batch = test::measured_check(*robot_, {}, 3);
  for (std::size_t i = 0; i < batch.measurements.size(); ++i)
    batch.measurements[i].session_id = i < batch.measurements.size() / 2 ? "morning" : "noon";
  batch = parse_batch_csv(to_csv(batch), "two.csv").value();
  const Cell& cell = robot_->model.cell();
  const auto check =
      check_health(robot_->model, check_against_cell(batch, cell).value(), tolerance_mm(0.05));
  ASSERT_FALSE(check);
  EXPECT_EQ(check.error().field, "session_id");
  EXPECT_FALSE(check.error().next.empty());
}

TEST_F(HealthTest, ZerosOfSeveralJointsAreOneAnswerWithEachZeroInDegrees) {
  for (const auto& [one, other] :
       {std::pair(3, 4), std::pair(3, 6), std::pair(4, 6), std::pair(4, 5)}) {
    for (std::uint64_t seed = 1; seed <= 3; ++seed) {
      const HealthCheck check =
          checked(*robot_, {{zero_off(*robot_, one, 1e-3), zero_off(*robot_, other, -7e-4)}}, seed,
                  tolerance_mm(0.05));
      ASSERT_EQ(check.changed.size(), 1u) << check.sentence;
      const SeenChange& change = check.changed.front();
      ASSERT_EQ(joints_of(change.zeros), (std::vector<int>{one, other})) << check.sentence;
      EXPECT_NEAR(change.zeros[0].by, 1e-3, 2 * change.zeros[0].u95);
      EXPECT_NEAR(change.zeros[1].by, -7e-4, 2 * change.zeros[1].u95);
      EXPECT_NE(check.sentence.find("was it remastered?"), std::string::npos) << check.sentence;
    }
  }
}

TEST_F(HealthTest, ZerosThatAreOffByDegreesAreNamedToo) {
  const std::vector<double> off = {0.05, -0.09, 0.07, 0.03};  // rad, of joints 2 to 5
  std::vector<hidden::Effect> effects;
  for (int k = 0; k < 4; ++k)
    effects.push_back(zero_off(*robot_, k + 2, off[static_cast<std::size_t>(k)]));
  const HealthCheck check = checked(*robot_, {effects}, 1, tolerance_mm(0.05));
  ASSERT_FALSE(check.changed.empty()) << check.sentence;
  const std::vector<LostZero>& zeros = check.changed.front().zeros;
  ASSERT_EQ(joints_of(zeros), (std::vector<int>{2, 3, 4, 5})) << check.sentence;
  for (std::size_t k = 0; k < zeros.size(); ++k) EXPECT_NEAR(zeros[k].by, off[k], 1e-3);
}

TEST_F(HealthTest, AZeroThatAnotherToolWouldMakeUpForIsNeverNamedWithoutTheTool) {
  const HealthCheck check = checked(
      *robot_,
      {{zero_off(*robot_, 4, 1e-3), zero_off(*robot_, 5, 1e-3), zero_off(*robot_, 6, 2e-3)}}, 1,
      tolerance_mm(0.05));
  ASSERT_EQ(check.changed.size(), 1u) << check.sentence;
  const SeenChange& change = check.changed.front();
  EXPECT_EQ(joints_of(change.zeros), (std::vector<int>{4, 5, 6})) << check.sentence;
  EXPECT_TRUE(std::any_of(
      change.could_also_be.begin(), change.could_also_be.end(),
      [](const SingleCause& other) { return other.record->spelling == "tool_changed"; }))
      << check.sentence;
}

TEST_F(HealthTest, NoWorldOfLostZerosGetsASureNameThatIsWrongNorASizeThatThePosesDoNotShow) {
  hidden::Random random(42);
  constexpr int kWorlds = 14;
  int named = 0;
  for (int k = 0; k < kWorlds; ++k) {
    const test::Remastered world = test::draw_remastered(test::sets_of_six_axes(), random);
    const HealthCheck check = checked(*robot_, {effects_of(world, *robot_, random)},
                                      100 + static_cast<std::uint64_t>(k), tolerance_mm(0.1));
    const bool right = test::is_right(check, world);
    EXPECT_TRUE(right || !test::is_sure(check))
        << fmt::format("{} ({}): ", k, fmt::join(world.joints, " ")) << check.sentence;
    for (const SeenChange& change : check.changed) {
      EXPECT_TRUE(std::isfinite(change.effect_rms) && std::isfinite(change.u95)) << check.sentence;
      EXPECT_LE(change.effect_rms, 1.01 * check.rms) << check.sentence;
    }
    named += right ? 1 : 0;
  }
  EXPECT_GE(named, 13);
}

TEST_F(HealthTest, PosesAtOnePlaceWithoutOrientationsCannotTell) {
  CheckedRobot turned = *robot_;
  for (std::size_t k = 0; k < turned.planned.size(); ++k) {
    turned.planned[k] = robot_->planned.front();
    turned.planned[k](5) += 0.3 * static_cast<double>(k);  // rad
  }
  const Cell& cell = robot_->model.cell();
  MeasurementBatch batch = test::measured_check(turned, {{zero_off(*robot_, 4, 2e-3)}}, 3);
  for (Measurement& m : batch.measurements) m.R_WT.reset();
  const auto check =
      check_health(robot_->model, check_against_cell(batch, cell).value(), tolerance_mm(0.05));
  if (!check) return;  // taken for a mistake of reading
  EXPECT_EQ(check->verdict, HealthVerdict::kCannotTell) << check->sentence;
  EXPECT_NE(check->sentence.find("spread"), std::string::npos) << check->sentence;
}

TEST_F(HealthTest, WhereTwoZerosExplainMoreThanOneTheCheckIsNotSureOfOneAlone) {
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    const HealthCheck check =
        checked(*robot_, {{zero_off(*robot_, 2, 4e-5), zero_off(*robot_, 3, -4e-5)}}, seed,
                tolerance_mm(0.05));
    if (!test::is_sure(check) || check.changed.front().zeros.size() != 1) continue;
    const LostZero& zero = check.changed.front().zeros.front();
    EXPECT_LE(std::abs(zero.by - (zero.joint == 1 ? 4e-5 : -4e-5)), 1.5 * zero.u95)
        << check.sentence;
  }
}

TEST_F(HealthTest, AnInstrumentThatMeasuresWorseThanItsSigmaSaysIsNoChangeOfTheRobot) {
  const Cell& cell = robot_->model.cell();
  hidden::Random random(13);
  std::normal_distribution<double> normal;
  int changed = 0;
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    MeasurementBatch batch = test::measured_check(*robot_, {}, seed);
    for (Measurement& m : batch.measurements) {
      m.p_W += 25e-6 * Vector3(normal(random), normal(random),
                               normal(random));  // twice the stated sigma in all
      m.R_WT.reset();
    }
    const HealthCheck check =
        check_health(robot_->model, check_against_cell(batch, cell).value(), tolerance_mm(0.05))
            .value();
    changed += check.verdict == HealthVerdict::kChanged ? 1 : 0;
  }
  EXPECT_LE(changed, 1);
}

TEST_F(HealthTest, PositionsThatAreNoisierThanTheOrientationsBesideThemAreNoChangeOfTheRobot) {
  const Cell& cell = robot_->model.cell();
  hidden::Random random(17);
  std::normal_distribution<double> normal;
  int sure = 0;
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    MeasurementBatch batch = test::measured_check(*robot_, {}, seed);
    for (Measurement& m : batch.measurements)
      m.p_W += 35e-6 * Vector3(normal(random), normal(random),
                               normal(random));  // thrice the stated sigma in all
    const HealthCheck check =
        check_health(robot_->model, check_against_cell(batch, cell).value(), tolerance_mm(0.05))
            .value();
    sure += test::is_sure(check) ? 1 : 0;
  }
  EXPECT_EQ(sure, 0);
}

TEST_F(HealthTest, LengthsThatAreAllTooLongAreAWarmArmOrTheInstrumentAndNoLink) {
  const Cell& cell = robot_->model.cell();
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    MeasurementBatch batch = test::measured_check(*robot_, {}, seed);
    for (Measurement& m : batch.measurements) m.p_W *= 1 + 2e-4;
    const HealthCheck check =
        check_health(robot_->model, check_against_cell(batch, cell).value(), tolerance_mm(0.05))
            .value();
    ASSERT_FALSE(check.changed.empty()) << check.sentence;
    EXPECT_EQ(check.changed.front().cause.record->spelling, "thermal_growth") << check.sentence;
    for (const SeenChange& change : check.changed)
      EXPECT_TRUE(std::any_of(
          change.could_also_be.begin(), change.could_also_be.end(),
          [](const SingleCause& other) { return other.record->spelling == "instrument_scale"; }))
          << check.sentence;
  }
}

TEST_F(HealthTest, ACauseThatExplainsAsMuchWithMoreNumbersIsSaidToBePossible) {
  const Cell& cell = robot_->model.cell();
  int listed = 0;
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    MeasurementBatch batch = test::measured_check(*robot_, {}, 20 + seed);
    for (Measurement& m : batch.measurements) m.p_W += *m.R_WT * Vector3(2e-4, 0, 0);
    const HealthCheck check =
        check_health(robot_->model, check_against_cell(batch, cell).value(), tolerance_mm(0.05))
            .value();
    ASSERT_FALSE(check.changed.empty()) << check.sentence;
    const SeenChange& first = check.changed.front();
    const auto is_tool = [](const SingleCause& cause) {
      return cause.record->spelling.substr(0, 4) == "tool";
    };
    const auto& others = first.could_also_be;
    listed += is_tool(first.cause) || std::any_of(others.begin(), others.end(), is_tool) ? 1 : 0;
  }
  EXPECT_EQ(listed, 5);
}

}  // namespace
}  // namespace trammel
