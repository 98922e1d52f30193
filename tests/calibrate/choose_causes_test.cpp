#include "server/calibrate/causes/choose_causes.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "server/calibrate/calibrate_with_maps.h"
#include "server/calibrate/causes/joint_blocks.h"
#include "tests/support/demand.h"
#include "tests/support/heavy_arm.h"
#include "tests/support/virtual_robot.h"

// `error_sources: auto` on arms of the second simulation.
namespace trammel {
namespace {

/// Joint 2 is off by a wave of its own angle.
test::HeavyArm arm_with_wave(double amplitude) {
  test::HeavyArm arm = test::draw_heavy_arm({.seed = 5});
  hidden::Effect effect;
  effect.cause.cause = "joint_map";
  effect.act = [amplitude](const hidden::MeasuringPose& pose, const Eigen::VectorXd&,
                           hidden::Moment& moment) {
    moment.q(1) += amplitude * std::sin(3 * pose.q(1) + 1);
  };
  arm.world.effects = {effect};
  return arm;
}

bool has(const std::vector<std::string>& sources, const std::string& begin) {
  return std::any_of(sources.begin(), sources.end(),
                     [&](const std::string& source) { return source.starts_with(begin); });
}

double missed(const CalibrationResult& found, const MeasurementBatch& batch) {
  double sum = 0;
  for (const Measurement& m : batch.measurements)
    sum += (m.p_W - found.model.pose_W(m.context).translation()).squaredNorm();
  return std::sqrt(sum / static_cast<double>(batch.measurements.size()));
}

TEST(ChooseCauses, TakeWhatAnArmHasAndLeaveWhatItHasNot) {
  const test::HeavyArm arm = arm_with_wave(2e-4);
  const MeasurementBatch batch = test::measured(arm, 200, 1);
  const ChosenCauses chosen = test::demand(choose_causes(arm.cell, {}, batch));
  for (const char* there : {"base", "geometry", "tool", "compliance", "self_weight", "joint_map:2"})
    EXPECT_TRUE(has(chosen.sources, there)) << there;
  for (const char* not_there : {"joint_map:1", "joint_map:5", "wrist_coupling"})
    EXPECT_FALSE(has(chosen.sources, not_there)) << not_there;
  ASSERT_FALSE(chosen.choice.tried.empty());
  for (const TriedCause& tried : chosen.choice.tried) {
    EXPECT_FALSE(tried.why.empty());
    if (tried.sources.front() == "encoder_eccentricity:2") {
      EXPECT_LT(tried.gain, 3) << "the map of joint 2 has this wave already";
    }
    if (!tried.taken || tried.gain > 20) continue;
    EXPECT_LT(tried.held_out_after, tried.held_out_before);
  }
}

TEST(ChooseCauses, SaysHowFarItIsAndStopsWhereItIsAskedTo) {
  const test::HeavyArm arm = arm_with_wave(2e-4);
  const MeasurementBatch batch = test::measured(arm, 60, 1);
  std::vector<double> shares;
  const ChosenCauses all = test::demand(choose_causes(arm.cell, {}, batch, [&](double share) {
    shares.push_back(share);
    return Status();
  }));
  EXPECT_GT(shares.size(), all.choice.tried.size()) << "a share for each cause that is tried";
  EXPECT_TRUE(std::is_sorted(shares.begin(), shares.end()));
  EXPECT_GT(shares.front(), 0);
  EXPECT_LT(shares.back(), 1);
  const auto stopped = choose_causes(arm.cell, {}, batch, [](double share) -> Status {
    if (share > 0.5) return failure(ErrorCode::kBusy, "given up on request");
    return {};
  });
  ASSERT_FALSE(stopped);
  EXPECT_EQ(stopped.error().code, ErrorCode::kBusy);
}

TEST(ChooseCauses, WhatIsChosenPredictsFreshPosesAsWellAsTheTruthsOwnCauses) {
  const test::HeavyArm arm = arm_with_wave(2e-4);
  const MeasurementBatch batch = test::measured(arm, 200, 1);
  const MeasurementBatch fresh = test::measured(arm, 500, 2);
  const ChosenCauses chosen = test::demand(choose_causes(arm.cell, {}, batch));
  const std::vector<std::string> truth = {"base", "geometry", "compliance", "joint_map:2"};
  const double by_itself =
      missed(test::demand(calibrate_with_maps(arm.cell, chosen.sources, batch, {})), fresh);
  const double told = missed(
      test::demand(calibrate_with_maps(arm.cell, truth, batch, {.held = {}, .weigh_links = true})),
      fresh);
  EXPECT_LE(by_itself, 1.03 * told);
  const double usual =
      missed(test::demand(calibrate_with_maps(arm.cell, {"base", "geometry", "compliance"}, batch,
                                              {.held = {}, .weigh_links = true})),
             fresh);
  EXPECT_LE(by_itself, 0.5 * usual);
}

TEST(ChooseCauses, SayInWhichFormGearboxesGiveWay) {
  const test::HeavyArm arm = arm_with_wave(0);
  const ChosenCauses chosen =
      test::demand(choose_causes(arm.cell, {}, test::measured(arm, 100, 1)));
  EXPECT_TRUE(has(chosen.sources, "compliance_"));
  EXPECT_EQ(std::count(chosen.sources.begin(), chosen.sources.end(), "compliance"), 0);
}

TEST(ChooseCauses, WhatIsNamedStaysAndIsNotTriedAgain) {
  const test::HeavyArm arm = arm_with_wave(0);
  const MeasurementBatch batch = test::measured(arm, 60, 1);
  const ChosenCauses chosen = test::demand(choose_causes(arm.cell, {"joint_map:4"}, batch));
  EXPECT_EQ(std::count(chosen.sources.begin(), chosen.sources.end(), "joint_map:4"), 1);
  for (const TriedCause& tried : chosen.choice.tried)
    EXPECT_NE(tried.sources.front(), "joint_map:4");
}

TEST(ChooseCauses, FewPosesTakeNothingThatHarmsFreshPoses) {
  const test::HeavyArm arm = arm_with_wave(2e-5);
  const MeasurementBatch fresh = test::measured(arm, 500, 2);
  for (const int poses : {20, 40}) {
    const MeasurementBatch batch = test::measured(arm, poses, 3);
    const ChosenCauses chosen = test::demand(choose_causes(arm.cell, {}, batch));
    EXPECT_FALSE(has(chosen.sources, "axis_runout")) << poses;
    const double by_itself =
        missed(test::demand(calibrate_with_maps(arm.cell, chosen.sources, batch, {})), fresh);
    const double geometry =
        missed(test::demand(calibrate_with_maps(arm.cell, {"base", "geometry"}, batch, {})), fresh);
    EXPECT_LE(by_itself, 1.02 * geometry) << poses;
  }
}

TEST(ChooseCauses, FindRunOutAndStiffnessThatAreHidden) {
  test::HeavyArm arm = test::draw_heavy_arm({.seed = 5});
  hidden::Random random(11);
  const hidden::Scene scene{arm.world.arm, &arm.world.poses, 1, 1};
  hidden::HiddenCause cause;
  cause.cause = "axis_runout";
  cause.joint = 3;
  hidden::Effect effect = hidden::draw_effect(cause, scene, random);
  effect.values.setConstant(1e-4);
  arm.world.effects = {effect};
  const MeasurementBatch batch = test::measured(arm, 200, 1);
  const ChosenCauses chosen = test::demand(choose_causes(arm.cell, {}, batch));
  for (const char* there : {"compliance", "self_weight", "axis_runout:3"})
    EXPECT_TRUE(has(chosen.sources, there)) << there;
  for (const char* not_there : {"axis_runout:1", "axis_runout:2", "axis_runout:6", "joint_map"})
    EXPECT_FALSE(has(chosen.sources, not_there)) << not_there;
}

/// 73.2 waves a turn are finer than a map, and no whole number.
TEST(ChooseCauses, FindTheRippleOfAGearThatIsFinerThanAMap) {
  test::HeavyArm arm = test::draw_heavy_arm({.seed = 5});
  hidden::Effect effect;
  effect.cause.cause = "gear_transmission";
  effect.act = [](const hidden::MeasuringPose& pose, const Eigen::VectorXd&,
                  hidden::Moment& moment) { moment.q(2) += 2e-4 * std::sin(73.2 * pose.q(2) + 1); };
  arm.world.effects = {effect};
  const MeasurementBatch batch = test::measured(arm, 200, 1);
  const ChosenCauses chosen = test::demand(choose_causes(arm.cell, {}, batch));
  EXPECT_TRUE(has(chosen.sources, "gear_transmission:3@73.")) << chosen.sources.back();
  for (const char* not_there : {"gear_transmission:1", "gear_transmission:5", "joint_map"})
    EXPECT_FALSE(has(chosen.sources, not_there)) << not_there;
}

TEST(ChooseCauses, TakeNothingWhereGeometryAloneIsTrue) {
  const auto cell = test::cell_7();
  VirtualRobot robot = test::chapter_5_robot(cell);
  const std::vector<Parameter> parameters = robot.truth.parameters();
  for (std::size_t k = 0; k < parameters.size(); ++k)
    if (parameters[k].name.starts_with("C")) robot.truth.values(static_cast<Eigen::Index>(k)) = 0;
  for (const std::uint64_t seed : {1, 2, 3}) {
    const MeasurementBatch batch = test::measured(robot, 100, seed);
    const ChosenCauses chosen = test::demand(choose_causes(cell, {}, batch));
    EXPECT_EQ(chosen.sources, (std::vector<std::string>{"base", "geometry", "tool"}));
    EXPECT_FALSE(chosen.choice.tried.empty());
    for (const TriedCause& tried : chosen.choice.tried)
      EXPECT_FALSE(tried.taken) << tried.sources.front();
  }
}

TEST(ChooseCauses, RowsOfOneJointVectorAreLeftOutTogether) {
  const test::HeavyArm arm = arm_with_wave(0);
  MeasurementBatch batch = test::measured(arm, 40, 1);
  const std::size_t rows = batch.measurements.size();
  for (std::size_t i = 0; i < rows; ++i) batch.measurements.push_back(batch.measurements[i]);
  const auto blocks = joint_blocks(batch);
  EXPECT_EQ(blocks.size(), 8U);
  std::vector<std::size_t> block_of(2 * rows);
  for (std::size_t b = 0; b < blocks.size(); ++b)
    for (const std::size_t row : blocks[b]) block_of[row] = b;
  for (std::size_t i = 0; i < rows; ++i) EXPECT_EQ(block_of[i], block_of[i + rows]);
}

/// Three rows a pose that say the same show the arm no better than one, but for the noise of the
/// instrument.
TEST(ChooseCauses, RowsOfOneJointVectorAreNoFurtherEvidence) {
  const test::HeavyArm arm = arm_with_wave(2e-4);
  const MeasurementBatch once = test::measured(arm, 100, 1);
  MeasurementBatch thrice = once;
  for (int more = 0; more < 2; ++more)
    thrice.measurements.insert(thrice.measurements.end(), once.measurements.begin(),
                               once.measurements.end());
  const auto gain_of_map = [&](const MeasurementBatch& batch) {
    for (const TriedCause& tried : test::demand(choose_causes(arm.cell, {}, batch)).choice.tried)
      if (tried.sources.front() == "joint_map:2") return tried.gain;
    return 0.0;
  };
  const double of_one = gain_of_map(once), of_three = gain_of_map(thrice);
  EXPECT_GT(of_one, 10);
  EXPECT_LT(of_three, 2 * of_one);
}

/// Gains by forward selection against the evidence of a calibration with and without the cause,
/// which integrates over the same priors about its own solution.
TEST(ChooseCauses, GainsByHowMuchLikelierTheCalibrationIs) {
  const test::HeavyArm arm = arm_with_wave(2e-4);
  const MeasurementBatch batch = test::measured(arm, 200, 1);
  const ChosenCauses chosen = test::demand(choose_causes(arm.cell, {}, batch));
  std::vector<std::string> without;
  for (const std::string& source : chosen.sources)
    if (!source.starts_with("joint_map:2")) without.push_back(source);
  const double more =
      test::demand(calibrate_with_maps(arm.cell, chosen.sources, batch, {})).log_evidence;
  const double less = test::demand(calibrate_with_maps(arm.cell, without, batch, {})).log_evidence;
  for (const TriedCause& tried : chosen.choice.tried) {
    if (tried.sources.front() != "joint_map:2") continue;
    EXPECT_GT(tried.gain, 0.3 * (more - less));
    EXPECT_GT(more, less);
  }
}

}  // namespace
}  // namespace trammel
