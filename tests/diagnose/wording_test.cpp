#include "server/diagnose/tell/wording.h"

#include <gtest/gtest.h>

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

TEST(Wording, KeepsDoubtfulFindingsApart) {
  EXPECT_EQ(
      sentence_for(with({found(kDrift, {kWarm}), found(kWarm, {kDrift})})),
      "Missing, but these poses do not tell which it is: tracker drift (20 um rms), or thermal growth; and thermal "
      "growth (20 um rms), or tracker drift.");
}

TEST(Wording, LeavesManyDoubtfulFindingsToTheTable) {
  const std::string sentence = sentence_for(with(std::vector<Finding>(6, found(kDrift, {kWarm}))));
  EXPECT_NE(sentence.find("; and 3 more, which the findings list."), std::string::npos) << sentence;
}

TEST(Wording, NamesASinglePoseAsAnOutlierAndSaysThatNothingElseWasFound) {
  EXPECT_EQ(sentence_for(with({found(kPose6)})),
            "Pose 6 (0.02 mm) is an outlier: single pose, cause not separable; repeat it and its neighbours. Nothing "
            "else was found in 80 poses: 12 um rms are left.");
  EXPECT_EQ(sentence_for(with({found(kPose6), found(kPose9), found(kBacklash)})),
            "Missing from the simulation: backlash in joint 2 (20 um rms). Pose 6 (0.02 mm) and pose 9 (0.02 mm) are "
            "outliers: single "
            "poses, cause not separable; repeat them and their neighbours.");
}

TEST(Wording, CallsNoiseOnlyWhatTheInstrumentMayDo) {
  EXPECT_EQ(noise_name(11e-6, 9e-6), "noise of one measurement");
  EXPECT_EQ(noise_name(70e-6, 9e-6), "what stays unexplained of a pose");
  Diagnosis real = with({});
  real.unexplained = {true, {}, 1.2e-4, 1e-12, "more than noise: 70 um an axis are left"};
  EXPECT_EQ(sentence_for(real), "More than noise: 70 um an axis are left.");
}

TEST(Wording, KnowsWhatWasLookedForByTheOrderOfThePoses) {
  const Unseen growth = {kWarm, 0, {}, {}, "temperatures"};
  EXPECT_TRUE(is_looked_for_by_order(growth, with_temperatures(false)));
  EXPECT_FALSE(is_looked_for_by_order(growth, with_temperatures(true))) << "recorded, but constant: not looked for";
  EXPECT_FALSE(is_looked_for_by_order({{"payload"}, 0, {}, {}, "a payload"}, with_temperatures(false)));
  EXPECT_FALSE(is_looked_for_by_order({kWarm, 0.5, 1e-5, {}, ""}, with_temperatures(false))) << "it could be seen";
}

}  // namespace
}  // namespace trammel
