#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "server/diagnose/tell/doubts.h"
#include "tests/support/demand.h"
#include "tests/support/diagnosis_trial.h"
#include "tests/support/process.h"
#include "tests/support/quick_diagnosis.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/virtual_robot.h"

// An effect is hidden by a simulation that shares nothing with the server's; the diagnosis sees a
// batch, a cell and a robot file and must find it, or say that it cannot. A bounded part of what
// diagnose_benchmark does at length.

namespace trammel {
namespace {

using hidden::HiddenSpec;
using test::Judgement;

/// What is said of a case; the whole verdict goes with every failure.
struct Answer {
  Judgement judgement;
  Diagnosis diagnosis;
  std::string shown;
};

Answer answer_to(const HiddenSpec& spec, const DiagnoseOptions& options = test::quick()) {
  const hidden::HiddenCase hidden = hidden::hide(spec);
  Answer answer;
  answer.diagnosis = test::demand(test::diagnose_files(hidden, options));
  answer.judgement = test::judge(answer.diagnosis, hidden);
  answer.shown = to_json(hidden.truth, hidden.world) + test::told(answer.diagnosis);
  return answer;
}

/// The lines of a CSV after its header, last first.
std::string backwards(const std::string& csv) {
  std::istringstream lines(csv);
  std::string head, rows;
  for (std::string line; std::getline(lines, line);) {
    const bool is_row = head.find("q1_deg") != std::string::npos;
    if (is_row)
      rows = line + "\n" + rows;
    else
      head += line + "\n";
  }
  return head + rows;
}

std::string test_name(const testing::TestParamInfo<const char*>& info) {
  std::string name = info.param;
  std::erase(name, '_');
  std::replace(name.begin(), name.end(), '+', 'x');
  return name;
}

class HiddenEffect : public testing::TestWithParam<const char*> {};

TEST_P(HiddenEffect, IsNamedAndNothingElseIs) {
  const Answer answer = answer_to({.kind = GetParam(), .seed = 3, .lambda = 150, .poses = 160});
  EXPECT_TRUE(answer.judgement.exact) << answer.shown;
}

INSTANTIATE_TEST_SUITE_P(Causes, HiddenEffect,
                         testing::Values("gear_transmission", "encoder_eccentricity", "joint_map",
                                         "backlash", "wrist_coupling", "thermal_growth",
                                         "tracker_moved", "joint_slip", "tool_changed", "payload",
                                         "tool", "time_lag", "outlier", "geometry", "compliance",
                                         "backlash+outlier", "axis_runout", "base_compliance",
                                         "joint_coupling", "early_reading", "instrument_scale"),
                         test_name);

class HiddenNothing : public testing::TestWithParam<const char*> {};

TEST_P(HiddenNothing, GetsNoName) {
  for (const std::uint64_t seed : {1u, 2u}) {
    const Answer answer = answer_to({.kind = GetParam(), .seed = seed, .lambda = 30, .poses = 140});
    EXPECT_TRUE(answer.diagnosis.findings.empty()) << answer.shown;
  }
}

INSTANTIATE_TEST_SUITE_P(Nulls, HiddenNothing,
                         testing::Values("null_white", "null_structured", "null_permuted"),
                         test_name);

class HiddenUnknown : public testing::TestWithParam<const char*> {};

TEST_P(HiddenUnknown, IsCalledUnknownWithTheJointsItDependsOn) {
  const Answer answer = answer_to({.kind = GetParam(), .seed = 1, .lambda = 200, .poses = 160});
  EXPECT_TRUE(answer.judgement.unknown_rightly) << answer.shown;
  EXPECT_TRUE(answer.diagnosis.findings.empty()) << answer.shown;
}

INSTANTIATE_TEST_SUITE_P(Unknowns, HiddenUnknown, testing::Values("unknown_q4", "unknown_q2q3"),
                         test_name);

class HiddenUndecidable : public testing::TestWithParam<const char*> {};

TEST_P(HiddenUndecidable, IsAmongWhatCannotBeToldAndIsNotNamedAlone) {
  const Answer answer = answer_to({.kind = GetParam(), .seed = 2, .lambda = 150, .poses = 140});
  EXPECT_TRUE(answer.judgement.set_holds_truth) << answer.shown;
  EXPECT_FALSE(answer.judgement.over_confident) << answer.shown;
}

INSTANTIATE_TEST_SUITE_P(Undecidables, HiddenUndecidable,
                         testing::Values("backlash_one_side", "payload_alone", "tool_or_link",
                                         "tool_absorbed", "joint1_or_tracker", "joint6_or_tool",
                                         "constant_warmth"),
                         test_name);

class HiddenTwin : public testing::TestWithParam<const char*> {};

TEST_P(HiddenTwin, IsNotNamedAloneHoweverStrongItIs) {
  for (const std::uint64_t seed : {1, 2, 3}) {
    const Answer answer =
        answer_to({.kind = GetParam(), .seed = seed, .lambda = 600, .poses = 120});
    EXPECT_TRUE(answer.judgement.set_holds_truth) << answer.shown;
    EXPECT_FALSE(answer.judgement.over_confident) << answer.shown;
  }
}

INSTANTIATE_TEST_SUITE_P(Twins, HiddenTwin,
                         testing::Values("tool_or_link", "joint1_or_tracker", "joint6_or_tool"),
                         test_name);

TEST(HiddenEffectInterval, IsOfTwoStandardUncertaintiesAsInATraining) {
  const hidden::HiddenCase hidden = hidden::hide({.kind = "replica_p28", .seed = 1});
  const Diagnosis diagnosis = test::demand(test::diagnose_files(hidden, test::quick()));
  ASSERT_EQ(diagnosis.findings.size(), 1U);
  const Estimate& distance = diagnosis.findings[0].parameters.at(0);
  EXPECT_NEAR(distance.u95, 2 * 1e3 * diagnosis.noise, 1e-9 * distance.u95);
}

TEST(WhatCannotBeTold, IsListedOnceAPair) {
  for (const char* kind : {"payload_alone", "tool_absorbed", "joint6_or_tool"}) {
    const Answer answer = answer_to({.kind = kind, .seed = 2, .lambda = 150, .poses = 140});
    const std::vector<Inseparable>& pairs = answer.diagnosis.not_separable;
    EXPECT_FALSE(pairs.empty()) << kind;
    for (std::size_t k = 0; k < pairs.size(); ++k) {
      const std::vector<Cause> turned(pairs[k].causes.rbegin(), pairs[k].causes.rend());
      for (std::size_t i = 0; i < k; ++i) {
        EXPECT_FALSE(pairs[i].causes == pairs[k].causes || pairs[i].causes == turned)
            << to_string(turned.front()) << " and " << to_string(turned.back());
      }
    }
  }
}

TEST(HiddenEffectOnPositions, IsNamedWithoutOrientations) {
  const Answer answer = answer_to(
      {.kind = "gear_transmission", .seed = 4, .lambda = 150, .poses = 160, .orientation = false});
  EXPECT_TRUE(answer.judgement.exact) << answer.shown;
}

TEST(HiddenEffectInASmallRange, IsNamedOrLeftOpenButNotMistaken) {
  const Answer answer = answer_to(
      {.kind = "encoder_eccentricity", .seed = 2, .lambda = 100, .poses = 160, .ranges = "6dim-l"});
  EXPECT_EQ(answer.judgement.wrong, 0) << answer.shown;
}

TEST(HiddenHole28, IsTheOnlyPoseThatDoesNotBelong) {
  const Answer answer = answer_to({.kind = "replica_p28", .seed = 1});
  ASSERT_EQ(answer.diagnosis.findings.size(), 1u) << answer.shown;
  EXPECT_EQ(answer.diagnosis.findings[0].cause.cause, "outlier");
  EXPECT_EQ(answer.diagnosis.findings[0].cause.pose_id, "p28");
  EXPECT_EQ(answer.diagnosis.findings[0].action,
            "single pose, cause not separable: repeat it and its neighbours");
}

TEST(HiddenEffectExtended, PredictsPosesHeldOutAsWellAsWhoKnowsTheTruth) {
  test::Trial trial{
      "test",
      {.kind = "backlash", .seed = 6, .lambda = 300, .poses = 240, .validation_share = 0.4}};
  trial.compare_with_oracle = true;
  const test::TrialResult result = run_trial(trial, test::quick());
  ASSERT_EQ(result.error, "");
  EXPECT_LT(result.held_out_after_mm, 1.05 * result.oracle_mm.value()) << result.judgement.said;
  EXPECT_LT(result.held_out_after_mm, result.held_out_before_mm);
}

TEST(HiddenByOneProcess, IsFoundByAnother) {
  const test::TemporaryFolder folder;
  const std::string binary = TRAMMEL_BINARY_DIR;
  const test::Finished hide =
      test::run({binary + "/tests/trammel_hide", "--kind", "gear_transmission", "--seed", "12",
                 "--lambda", "150", "--poses", "160", "-o", folder.path().string()});
  ASSERT_EQ(hide.exit_code, 0) << hide.err;
  const test::Finished diagnose =
      test::run({binary + "/clients/trammel", "diagnose", "--cell", folder.file("cell.yaml"),
                 "--batch", folder.file("batch.csv"), "--json", folder.file("diagnosis.json")},
                std::chrono::seconds(120));
  ASSERT_EQ(diagnose.exit_code, 0) << diagnose.err;
  const auto truth = nlohmann::json::parse(test::read_file(folder.file("truth.json")))["causes"][0];
  const auto said = nlohmann::json::parse(test::read_file(folder.file("diagnosis.json")));
  EXPECT_EQ(said["verdict"], "named");
  ASSERT_EQ(said["findings"].size(), 1u) << said.dump(1);
  EXPECT_EQ(said["findings"][0]["cause"], truth["cause"]);
  EXPECT_EQ(said["findings"][0]["joint"], truth["joint"]);
  EXPECT_NEAR(said["findings"][0]["parameters"]["order"]["value"].get<double>(),
              truth["values"]["order"].get<double>(), 0.1);
}

TEST(HiddenStep, IsFoundWhereTheTimesSayButNotAppliedByARowWhenTheRowsAreInAnotherOrder) {
  hidden::HiddenCase hidden =
      hidden::hide({.kind = "tracker_moved", .seed = 3, .lambda = 150, .poses = 160});
  const Diagnosis in_order = test::demand(test::diagnose_files(hidden, test::quick()));
  hidden.batch_csv = backwards(hidden.batch_csv);
  const Diagnosis moved = test::demand(test::diagnose_files(hidden, test::quick()));
  ASSERT_EQ(in_order.findings.size(), 1U);
  ASSERT_EQ(moved.findings.size(), 1U);
  EXPECT_EQ(moved.findings[0].cause, in_order.findings[0].cause);
  EXPECT_NE(in_order.sources_after, in_order.sources_before);
  EXPECT_EQ(moved.sources_after, moved.sources_before);
}

/// How a cause is judged beside `found` and an unknown dependence of that size (m), with everything
/// recorded.
cause_search::Judgement judged(const Cause& cause, double effect_rms,
                               const std::vector<Cause>& found, double unexplained_rms) {
  const Unexplained unexplained{unexplained_rms > 0, {"q2"}, unexplained_rms, 1e-6};
  MeasurementBatch recorded = test::measured(test::chapter_5_robot(test::cell_7()), 20, 1);
  for (Measurement& m : recorded.measurements) {
    m.context.time = m.context.index;
    m.context.temperature = 20;
  }
  return cause_search::judge(cause, {effect_rms}, {},
                             {found, unexplained, {}, recorded, unexplained.present});
}

std::vector<Cause> doubts(const Cause& cause, double effect_rms, const std::vector<Cause>& found) {
  return judged(cause, effect_rms, found, 0).could_also_be;
}

TEST(Doubt, IsCastOnASmallEffectBesideSomethingUnknownThatIsManyTimesLarger) {
  const Cause coupling{"wrist_coupling"};
  for (const double effect : {4e-6, 12e-6}) {
    EXPECT_EQ(judged(coupling, effect, {coupling}, 33e-6).could_also_be,
              std::vector<Cause>{{"unknown"}});
  }
  EXPECT_TRUE(judged(coupling, 4e-6, {coupling}, 33e-6).whole) << "no shape for the model";
  EXPECT_FALSE(judged(coupling, 12e-6, {coupling}, 33e-6).whole);
  EXPECT_TRUE(doubts(coupling, 4e-6, {coupling}).empty());
}

TEST(Doubt, AGearBesideAMapOfItsJointOrAmongThreeMayBeMoreOfThatMap) {
  const Cause map{"joint_map", 0}, beside_it{"gear_transmission", 0}, gear{"gear_transmission", 1};
  const std::vector<Cause> two = {map, beside_it, gear, gear};
  EXPECT_TRUE(doubts(map, 1e-4, two).empty());
  EXPECT_EQ(doubts(beside_it, 1e-4, two), std::vector<Cause>{map});
  EXPECT_TRUE(doubts(gear, 1e-4, two).empty()) << "an order and its double are one gear's";
  const std::vector<Cause> three = {map, beside_it, gear, gear, gear};
  EXPECT_EQ(doubts(gear, 1e-4, three), (std::vector<Cause>{{"joint_map", 1}}));
}

/// The shipped robot in a cell that knows only of its base, these numbers of its geometry wrong.
MeasurementBatch with_wrong_geometry(const std::shared_ptr<const Cell>& cell,
                                     const std::map<std::string, double>& wrong, int poses) {
  VirtualRobot robot = test::chapter_5_robot(cell);
  robot.truth = test::demand(make_physical_model(cell, {"base", "geometry"}));
  const std::vector<Parameter> parameters = robot.truth.parameters();
  for (std::size_t k = 0; k < parameters.size(); ++k) {
    const auto value = wrong.find(parameters[k].name);
    if (value != wrong.end()) robot.truth.values(static_cast<Eigen::Index>(k)) = value->second;
  }
  return test::measured(robot, poses, 7);
}

TEST(NumberOfAGeometry, IsGivenBesideTheOthersOfItsSourceWhereTheseAreWrongToo) {
  Cell lacking = *test::cell_7();
  lacking.model.error_sources = {"base"};
  const auto cell = std::make_shared<const Cell>(lacking);
  const double q2 = -5e-4;
  const Diagnosis several = test::demand(diagnose(
      cell, with_wrong_geometry(cell, {{"q2", q2}, {"d4", -3e-5}, {"a2", 4e-5}, {"q3", 4e-5}}, 120),
      test::quick()));
  ASSERT_EQ(several.findings.size(), 1U) << several.sentence;
  EXPECT_EQ(several.findings[0].cause.parameter, "") << "not it alone";
  const auto& numbers = several.findings[0].parameters;
  const auto of_q2 = std::find_if(numbers.begin(), numbers.end(),
                                  [](const Estimate& e) { return e.name == "q2"; });
  ASSERT_NE(of_q2, numbers.end());
  EXPECT_NEAR(of_q2->value, q2, 2 * of_q2->u95);
  const Diagnosis alone =
      test::demand(diagnose(cell, with_wrong_geometry(cell, {{"q2", q2}}, 120), test::quick()));
  ASSERT_EQ(alone.findings.size(), 1U) << alone.sentence;
  EXPECT_EQ(alone.findings[0].cause.parameter, "q2");
}

TEST(TheOnlyCauseOfARobot, IsNamedForCertainWhereThePosesHeldOutGainByIt) {
  const hidden::HiddenCase hidden =
      hidden::hide({.kind = "base", .seed = 1001, .lambda = 120, .poses = 300});
  const Diagnosis diagnosis = test::demand(test::diagnose_files(hidden, test::quick()));
  ASSERT_EQ(diagnosis.findings.size(), 1U) << test::told(diagnosis);
  const Finding& base = diagnosis.findings.front();
  EXPECT_EQ(base.cause.cause, "base");
  EXPECT_TRUE(base.could_also_be.empty()) << test::told(diagnosis);
  EXPECT_NEAR(base.held_out_gain, diagnosis.held_out_before->rms - diagnosis.held_out_after->rms,
              1e-9)
      << "there is nothing else in the model";
}

TEST(Doubt, WhatOnlySomePosesRecordIsNotLookedForAndSaid) {
  hidden::HiddenCase hidden =
      hidden::hide({.kind = "thermal_growth", .seed = 2, .lambda = 300, .poses = 120});
  MeasurementBatch batch = test::demand(parse_batch_csv(hidden.batch_csv, "batch"));
  for (std::size_t i = 0; i < batch.measurements.size(); i += 2)
    batch.measurements[i].context.temperature.reset();
  hidden.batch_csv = to_csv(batch);
  const Diagnosis diagnosis = test::demand(test::diagnose_files(hidden, test::quick()));
  const auto says = [](const std::string& limit) {
    return limit.find("temperatures of 60 of 120 poses") == 0;
  };
  EXPECT_TRUE(std::any_of(diagnosis.limits.begin(), diagnosis.limits.end(), says))
      << test::told(diagnosis);
  for (const Finding& finding : diagnosis.findings)
    EXPECT_FALSE(finding.could_also_be.empty()) << test::told(diagnosis);
}

TEST(MapsOfJoints, AreOneFindingAJointAlsoWhereFineDetailShowsOnlyBesideAllElse) {
  const auto cell = test::cell_7();
  VirtualRobot robot = test::chapter_5_robot(cell);
  for (const char* spec : {"joint_map:2@20", "joint_map:3@20", "joint_map:5@20"}) {
    const Eigen::Index first =
        add_source(robot.truth, test::demand(make_error_source(spec, *cell)));
    for (Eigen::Index k = 0; k < 40; ++k) {
      const double size = k < 12 ? 3e-4 : 2e-5;
      robot.truth.values(first + k) = size * std::sin(static_cast<double>(k * k + first));
    }
  }
  const Diagnosis diagnosis =
      test::demand(diagnose(cell, test::measured(robot, 300, 71), test::quick()));
  std::set<int> joints;
  for (const Finding& finding : diagnosis.findings) {
    if (finding.cause.cause != "joint_map") continue;
    EXPECT_TRUE(joints.insert(finding.cause.joint).second);
  }
  EXPECT_EQ(joints, (std::set<int>{1, 2, 4})) << diagnosis.sentence;
  EXPECT_LT(diagnosis.after.rms, 0.05 * diagnosis.before.rms);
}

TEST(FormOfACompliance, IsChosenAgainBesideWhatIsFoundLaterSoThatNothingElseIsNamedForIt) {
  const auto shipped = test::cell_7();
  for (const bool own : {false, true}) {
    Cell lacking = *shipped;
    lacking.model.error_sources =
        own ? std::vector<std::string>{"base", "compliance"} : std::vector<std::string>{"base"};
    const auto cell = std::make_shared<const Cell>(lacking);
    const Diagnosis diagnosis = test::demand(
        diagnose(cell, test::measured(test::chapter_5_robot(shipped), 200, 5), test::quick()));
    std::set<std::string> causes;
    for (const Finding& finding : diagnosis.findings) causes.insert(finding.cause.cause);
    EXPECT_EQ(causes, own ? std::set<std::string>{"geometry"}
                          : (std::set<std::string>{"compliance", "geometry"}))
        << diagnosis.sentence;
    EXPECT_FALSE(diagnosis.unexplained.present) << diagnosis.sentence;
    if (own) {
      EXPECT_EQ(diagnosis.sources_after,
                (std::vector<std::string>{"base", "compliance_linear", "geometry"}));
    }
  }
}

TEST(NextPoses, TellApartWhatTheBatchConfoundsMoreThanRandomOnesWould) {
  test::Trial trial{.row = "next",
                    .spec = {.kind = "encoder_eccentricity",
                             .seed = 703,
                             .lambda = 60,
                             .poses = 300,
                             .ranges = "6dim-l",
                             .cell_ranges = "calibration"},
                    .compare_with_oracle = false,
                    .compare_next_poses = true};
  DiagnoseOptions options = test::quick();
  options.next_poses = 10;
  const test::TrialResult result = run_trial(trial, options);
  ASSERT_TRUE(result.next_poses_measured) << result.judgement.said;
  EXPECT_GT(result.next_poses_measured->random_over_suggested(), 2);
  EXPECT_GT(result.next_poses_measured->reduction(), 1.0);
  EXPECT_GT(result.next_poses_claimed->random_over_suggested(), 1.3);
}

}  // namespace
}  // namespace trammel
