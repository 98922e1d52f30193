#include <gtest/gtest.h>

#include <algorithm>

#include "server/diagnose/tell/doubts.h"
#include "tests/support/demand.h"
#include "tests/support/diagnosis_trial.h"
#include "tests/support/quick_diagnosis.h"
#include "tests/support/virtual_robot.h"

// What has another form than all known causes is explained in part by the nearest of them. That
// one's name is not sure.

namespace trammel {
namespace {

bool may_be_unknown(const Finding& finding) {
  return std::any_of(finding.could_also_be.begin(), finding.could_also_be.end(),
                     [](const Cause& other) { return other.cause == "unknown"; });
}

bool is_outlier(const Finding& finding) { return finding.cause.cause == "outlier"; }

/// A kind, and strengths as robots show them on 160 poses.
struct Foreign {
  const char* kind;
  double lambda;
};

class ForeignShape : public testing::TestWithParam<Foreign> {};

TEST_P(ForeignShape, IsNotTakenForACauseForCertain) {
  for (const std::uint64_t seed : {1, 2}) {
    const hidden::HiddenCase hidden = hidden::hide(
        {.kind = GetParam().kind, .seed = seed, .lambda = GetParam().lambda, .poses = 160});
    const Diagnosis diagnosis = test::demand(test::diagnose_files(hidden, test::quick()));
    const std::string shown = fmt::format("seed {}: {}", seed, test::told(diagnosis));
    EXPECT_NE(diagnosis.verdict, Verdict::kNamed) << shown;
    EXPECT_NE(diagnosis.verdict, Verdict::kNothing) << shown;
    for (const Finding& finding : diagnosis.findings)
      EXPECT_TRUE(is_outlier(finding) || may_be_unknown(finding))
          << to_string(finding.cause) << ' ' << shown;
  }
}

INSTANTIATE_TEST_SUITE_P(
    Of, ForeignShape,
    testing::Values(Foreign{"foreign_wave", 3000}, Foreign{"foreign_seam", 3000},
                    Foreign{"foreign_crack", 3000}, Foreign{"foreign_mount", 3000},
                    Foreign{"foreign_walks", 30000}, Foreign{"foreign_loads", 30000}),
    [](const auto& kind) { return std::string(kind.param.kind).substr(8); });

/// How `cause` of `effect` (m) is judged beside what depends on `on`, with everything recorded.
cause_search::Judgement judged(const Cause& cause, const cause_search::Evidence& evidence,
                               const std::string& on, const std::vector<Cause>& found,
                               bool more_than_noise = true) {
  const Unexplained unexplained{!on.empty(), {on}, on.empty() ? 0 : 30e-6, 1e-6};
  MeasurementBatch recorded = test::measured(test::chapter_5_robot(test::cell_7()), 20, 1);
  for (Measurement& m : recorded.measurements) {
    m.context.time = m.context.index;
    m.context.temperature = 20;
  }
  return cause_search::judge(cause, evidence, {},
                             {found, unexplained, {}, recorded, more_than_noise, 30e-6});
}

TEST(BesideSomethingUnknown, ACauseIsTheBestKnownShapeHoweverLargeItIs) {
  const Cause coupling{"wrist_coupling"};
  for (const double effect : {8e-6, 20e-6, 40e-6, 400e-6}) {
    const cause_search::Judgement judgement = judged(coupling, {effect}, "q4", {coupling});
    EXPECT_EQ(judgement.could_also_be, std::vector<Cause>{{"unknown"}});
    EXPECT_FALSE(judgement.whole) << "it goes into the model, where poses held out judge it";
    EXPECT_EQ(judgement.action.find("find first what is unknown") == 0, effect < 30e-6)
        << judgement.action;
  }
  EXPECT_TRUE(judged(coupling, {7e-6}, "q4", {coupling}).whole)
      << "so small that it may be nothing at all";
}

TEST(BesideSomethingUnknown, WhatDiffersInFormOnlyIsTheBestKnownShapeAndAnotherCauseIsNot) {
  const Cause gear{"gear_transmission", 2}, map{"joint_map", 2},
      eccentricity{"encoder_eccentricity", 2};
  EXPECT_TRUE(cause_search::differ_in_form_only(gear, {map}));
  EXPECT_TRUE(cause_search::differ_in_form_only(gear, {}));
  EXPECT_FALSE(cause_search::differ_in_form_only(gear, {{"backlash", 2}}));
  EXPECT_FALSE(cause_search::differ_in_form_only(eccentricity, {{"unknown", 2}}));
}

TEST(BesideSomethingThatMoves, AStepAndAGrowthAreDoubted) {
  const Cause slip{.cause = "joint_slip", .joint = 2, .pose_id = "p10"};
  EXPECT_TRUE(judged(slip, {1e-4}, "time", {slip}).whole) << "in doubt, and no shape for the model";
  EXPECT_EQ(judged(slip, {1e-4}, "time", {slip}).could_also_be,
            (std::vector<Cause>{{"unknown", 2}}));
  EXPECT_NE(judged(slip, {1e-4}, "time", {slip}).action.find("moves slowly"), std::string::npos);
  const Cause growth{"thermal_growth"}, moved{.cause = "tracker_moved", .pose_id = "p10"};
  EXPECT_TRUE(judged(growth, {1e-4}, "", {growth}, false).could_also_be.empty());
  const cause_search::Judgement beside = judged(growth, {1e-4}, "", {growth, moved}, false);
  EXPECT_EQ(beside.could_also_be, std::vector<Cause>{{"unknown"}});
  EXPECT_NE(beside.action.find("scale of the instrument"), std::string::npos) << beside.action;
}

TEST(HeldOutPoses, ThatAreNotPredictedBetterPutACauseInDoubt) {
  const Cause gear{"gear_transmission", 2};
  EXPECT_TRUE(judged(gear, {1e-4}, "", {gear}, false).could_also_be.empty());
  const cause_search::Judgement doubted =
      judged(gear, {.effect_rms = 1e-4, .helps_held_out = false}, "", {gear}, false);
  EXPECT_EQ(doubted.could_also_be, (std::vector<Cause>{{"unknown", 2}}));
  EXPECT_TRUE(doubted.whole) << "it does not go into the model";
  EXPECT_NE(doubted.action.find("not predicted better"), std::string::npos) << doubted.action;
}

}  // namespace
}  // namespace trammel
