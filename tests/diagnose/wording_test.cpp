#include "server/diagnose/tell/wording.h"

#include <gtest/gtest.h>

#include "server/diagnose/tell/answers.h"

namespace trammel {
namespace {

Finding found(const Cause& cause, std::vector<Cause> could_also_be = {}) {
  Finding finding;
  finding.cause = cause;
  finding.effect_rms = 20e-6;
  finding.could_also_be = std::move(could_also_be);
  return finding;
}

const Cause kDrift = {"tracker_drift"};
const Cause kWarm = {"thermal_growth"};
const Cause kBacklash = {"backlash", 1};
const Cause kPose6 = {"outlier", -1, "", "6", {}};
const Cause kPose9 = {"outlier", -1, "", "9", {}};

Diagnosis with(std::vector<Finding> findings) {
  Diagnosis diagnosis;
  diagnosis.poses = 80;
  diagnosis.after.rms = 12e-6;
  diagnosis.findings = std::move(findings);
  return diagnosis;
}

MeasurementBatch with_temperatures(bool have) {
  MeasurementBatch batch;
  for (int i = 0; i < 20; ++i) {
    Measurement m;
    m.context.q = JointVector::Constant(6, 0.1 * i);
    m.context.time = 30.0 * i;
    if (have) m.context.temperature = 21;
    batch.measurements.push_back(m);
  }
  return batch;
}

TEST(Wording, SaysOneDoubtOnceFromWhicheverSideItIsSeen) {
  EXPECT_EQ(
      sentence_for(with({found(kDrift, {kWarm}), found(kWarm, {kDrift})})),
      "Found, but these poses leave open what it is: tracker drift or thermal growth (20 um rms).");
  EXPECT_EQ(sentence_for(with({found(kDrift, {unknown_cause()}), found(kWarm, {unknown_cause()})})),
            "Found, but these poses leave open what it is: perhaps tracker drift (20 um rms); and "
            "perhaps thermal growth (20 um rms).");
}

TEST(Wording, SaysWhatIsMissingThenTheGainThenWhatToDo) {
  Finding gear = found({"gear_transmission", 2, "", "", 53.2});
  gear.action = "have it looked at";
  Diagnosis named = with({gear, found(kBacklash)});
  named.before.rms = 50e-6;
  EXPECT_EQ(sentence_for(named),
            "Missing from the simulation: gear ripple in joint 3, 53.20 cycles a turn (20 um rms); "
            "and backlash in joint 2 (20 um rms). With that corrected, the error falls from 50 to "
            "12 um rms. What to do about gear ripple in joint 3: have it looked at.");
}

TEST(Wording, SaysWithWhatTheRestChanges) {
  EXPECT_EQ(circumstances_in_words({"q2"}), "the position of joint 2");
  EXPECT_EQ(circumstances_in_words({"q2", "q3", "time"}),
            "the positions of joints 2 and 3, and time");
  EXPECT_EQ(circumstances_in_words({"q5", "dir5"}),
            "the position of joint 5 and the side of approach of joint 5");
  EXPECT_EQ(circumstances_in_words({"dir1", "dir5"}), "the sides of approach of joints 1 and 5");
  EXPECT_EQ(circumstances_in_words({"torque", "temperature"}), "the torque and the temperature");
  Diagnosis unknown = with({});
  unknown.unexplained = {true, {"q2", "q3"}, 36e-6, 1e-6};
  EXPECT_EQ(sentence_for(unknown),
            "The error changes with the positions of joints 2 and 3 (36 um rms), as it would by no "
            "known cause.");
}

TEST(Wording, AsksForNoColumnThatTheBatchHas) {
  const std::string measure = "measure some reference poses again and again over the day";
  EXPECT_EQ(what_slow_changes_need({}), measure);
  EXPECT_EQ(what_slow_changes_need({.temperature = true}), measure + ", and record temperature_c");
  EXPECT_EQ(what_slow_changes_need({.time = true, .temperature = true}),
            measure + ", and record time_s and temperature_c");
}

TEST(Wording, LeavesManyDoubtfulFindingsToTheTable) {
  std::vector<Finding> many;
  for (int joint = 0; joint < 6; ++joint) many.push_back(found({"backlash", joint}, {kWarm}));
  const std::string sentence = sentence_for(with(many));
  EXPECT_NE(sentence.find("; and 3 smaller ones, which the findings list."), std::string::npos)
      << sentence;
}

TEST(Wording, NamesASinglePoseAsAnOutlierAndSaysThatNothingElseWasFound) {
  EXPECT_EQ(sentence_for(with({found(kPose6)})),
            "Pose 6 (0.02 mm) fits none of the others, and a single pose does not tell why: "
            "measure it and its neighbours again. Nothing else was found in 80 poses: 12 um rms "
            "are left, which looks like noise.");
  EXPECT_EQ(sentence_for(with({found(kPose6), found(kPose9), found(kBacklash)})),
            "Missing from the simulation: backlash in joint 2 (20 um rms). Pose 6 (0.02 mm) and "
            "pose 9 (0.02 mm) fit none of the others, and single poses do not tell why: measure "
            "them and their neighbours again.");
}

TEST(Wording, CallsAPoseWrongOnlyWhereNothingIsMissing) {
  const std::string sentence = sentence_for(with({found(kPose6, {unknown_cause()})}));
  EXPECT_EQ(sentence.find("Pose 6 (0.02 mm) fits none of the others, and what the simulation lacks "
                          "may be largest there"),
            0U)
      << sentence;
  EXPECT_EQ(sentence.find("bad measurement"), std::string::npos) << sentence;
}

TEST(Wording, IsUnknownWhereMoreIsLeftThanAnyDoubtfulFindingExplains) {
  Finding weights = found({"self_weight"}, {unknown_cause()});
  weights.source = "self_weight";
  Diagnosis diagnosis = with({weights, found(kPose6, {unknown_cause()})});
  diagnosis.unexplained = {true, {}, 40e-6, 1e-6};
  cause_search::tell_verdict(diagnosis);
  EXPECT_EQ(diagnosis.verdict, Verdict::kUnknown);
  diagnosis.unexplained.rms = 10e-6;
  cause_search::tell_verdict(diagnosis);
  EXPECT_EQ(diagnosis.verdict, Verdict::kAmbiguous);
  diagnosis.unexplained.rms = 40e-6;
  diagnosis.findings.front().could_also_be = {kDrift};
  cause_search::tell_verdict(diagnosis);
  EXPECT_EQ(diagnosis.verdict, Verdict::kAmbiguous);
}

TEST(Wording, CallsNoiseOnlyWhatTheInstrumentMayDo) {
  EXPECT_EQ(noise_name(11e-6, 9e-6), "noise of one measurement");
  EXPECT_EQ(noise_name(70e-6, 9e-6), "what stays unexplained of a pose");
  Diagnosis real = with({});
  real.unexplained = {true, {}, 1.2e-4, 1e-12, "more than noise is left: 4 times"};
  EXPECT_EQ(sentence_for(real),
            "More than noise is left: 4 times. No single joint, torque or time was found with "
            "which it changes.");
}

TEST(Wording, SaysThatPositionsWereComputedWhereTheyAreBetterThanTheInstrument) {
  Diagnosis log = with({});
  log.poses = 60;
  log.instrument = 30e-6;
  log.before.rms = log.after.rms = 0.5e-6;
  const std::string sentence = sentence_for(log);
  EXPECT_NE(sentence.find("computed, not measured"), std::string::npos) << sentence;
  log.before.rms = log.after.rms = 8e-6;  // a good arm beside a sigma that is stated too large
  EXPECT_EQ(sentence_for(log).find("computed"), std::string::npos) << sentence_for(log);
  EXPECT_EQ(sentence.find("noise"), std::string::npos) << sentence;
}

TEST(Wording, KnowsWhatWasLookedForByTheOrderOfThePoses) {
  const Unseen growth = {kWarm, 0, {}, {}, "temperatures"};
  EXPECT_TRUE(is_looked_for_by_order(growth, with_temperatures(false)));
  EXPECT_FALSE(is_looked_for_by_order(growth, with_temperatures(true)))
      << "recorded, but constant: not looked for";
  EXPECT_FALSE(
      is_looked_for_by_order({{"payload"}, 0, {}, {}, "a payload"}, with_temperatures(false)));
  EXPECT_FALSE(is_looked_for_by_order({kWarm, 0.5, 1e-5, {}, ""}, with_temperatures(false)))
      << "it could be seen";
}

}  // namespace
}  // namespace trammel
