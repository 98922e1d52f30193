#include "server/report/diagnosis_json.h"

#include <gtest/gtest.h>

#include "tests/report/diagnosis_fixture.h"

namespace trammel {
namespace {

TEST(DiagnosisJson, HasTheKeysThatProgramsAreToldOf) {
  const auto json = diagnosis_json(test::made_up_diagnosis(test::cell_7()));
  for (const char* key :
       {"verdict", "poses", "noise_mm", "before", "after", "held_out", "findings", "unexplained",
        "not_separable", "could_not_have_seen", "suspect_poses", "next_poses", "budget", "notes"}) {
    EXPECT_TRUE(json.contains(key)) << key;
  }
  for (const char* key : {"cause", "joint", "parameters", "effect_rms_mm", "held_out_gain_mm",
                          "strength", "p_value", "could_also_be", "action"}) {
    EXPECT_TRUE(json["findings"][0].contains(key)) << key;
  }
  EXPECT_EQ(json["verdict"], "ambiguous");
  EXPECT_TRUE(json["held_out"]["before"].contains("rms_mm"));
  EXPECT_TRUE(json["unexplained"]["present"].get<bool>());
}

TEST(DiagnosisJson, HasTheProofOnlyWhereOneWasMade) {
  Diagnosis diagnosis = test::made_up_diagnosis(test::cell_7());
  EXPECT_TRUE(diagnosis_json(diagnosis)["proof"].is_null());
  diagnosis.proof = test::made_up_proof();
  const auto proof = diagnosis_json(diagnosis)["proof"];
  EXPECT_DOUBLE_EQ(proof["named_share"], 0.9);
  EXPECT_EQ(proof["nothing_put_in"]["tried"], 12);
  EXPECT_EQ(proof["nothing_put_in"]["misnamed"], 1);
  EXPECT_EQ(proof["refused"], 2);
  const auto& gear = proof["causes"][0];
  EXPECT_EQ(gear["cause"], "gear_transmission");
  EXPECT_EQ(gear["joint"], 3);
  EXPECT_EQ(gear["outcome"], "proved");
  EXPECT_DOUBLE_EQ(gear["predicted_mm"], 0.024);
  EXPECT_DOUBLE_EQ(gear["smallest_mm"], 0.027);
  EXPECT_DOUBLE_EQ(gear["smallest_95_mm"][1], 0.031);
  EXPECT_EQ(gear["sizes"].size(), 3U);
  EXPECT_EQ(gear["sizes"][1]["named"], 6);
  EXPECT_EQ(proof["causes"][1]["outcome"], "never_named");
  EXPECT_TRUE(proof["causes"][1]["smallest_mm"].is_null());
  EXPECT_EQ(proof["causes"][2]["outcome"], "open");
  EXPECT_TRUE(proof["causes"][2]["smallest_95_mm"][1].is_null());
}

TEST(DiagnosisJson, HasTheNotesOfItsCellAsObjects) {
  const auto note = diagnosis_json(
      test::made_up_diagnosis(test::cell_7()),
      {{"robot_not_confirmed", Note::Severity::kWarning, "nobody compared it"}})["notes"][0];
  EXPECT_EQ(note["code"], "robot_not_confirmed");
  EXPECT_EQ(note["severity"], "warning");
  EXPECT_EQ(note["text"], "nobody compared it");
}

TEST(DiagnosisJson, CountsJointsFromOneAndSpeaksInMillimetresAndDegrees) {
  const Diagnosis diagnosis = test::made_up_diagnosis(test::cell_7());
  const auto json = diagnosis_json(diagnosis);
  EXPECT_EQ(json["findings"][0]["joint"], 3);
  EXPECT_TRUE(json["findings"][1]["joint"].is_null());
  EXPECT_EQ(json["findings"][1]["could_also_be"][0]["parameter"], "d6");
  EXPECT_DOUBLE_EQ(json["findings"][0]["parameters"]["order"]["u95"], 0.04);
  EXPECT_DOUBLE_EQ(json["findings"][0]["effect_rms_mm"], 0.058);
  EXPECT_DOUBLE_EQ(json["noise_mm"], 0.013);
  EXPECT_EQ(json["not_separable"][0].size(), 2u);
  EXPECT_EQ(json["next_poses"].size(), 10u);
  EXPECT_NEAR(json["next_poses"][0][0], to_deg(diagnosis.next_poses.q[0](0)), 1e-9);
  EXPECT_TRUE(json["could_not_have_seen"][1]["smallest_mm"].is_null());
}

TEST(DiagnosisJson, SaysWhenAStepMayHaveBegunAndWhichHeldOutPosesFitNeitherModel) {
  Diagnosis diagnosis = test::made_up_diagnosis(test::cell_7());
  EXPECT_FALSE(diagnosis_json(diagnosis)["findings"][0].contains("may_begin_at"));
  diagnosis.findings[0].may_begin_at = {{"p7", 8, 120.0}, {"p8", 9, std::nullopt}};
  diagnosis.suspects.push_back({"p9", 10, 1e-3, "held-out", true});
  diagnosis.held_out_before_without = diagnosis.before;
  const auto json = diagnosis_json(diagnosis);
  const auto& begins = json["findings"][0]["may_begin_at"];
  EXPECT_EQ(begins["pose_ids"].size(), 2u);
  EXPECT_EQ(begins["earliest"]["pose_id"], "p7");
  EXPECT_EQ(begins["earliest"]["time_s"], 120.0);
  EXPECT_TRUE(begins["latest"]["time_s"].is_null());
  EXPECT_TRUE(json["suspect_poses"].back()["held_out"].get<bool>());
  EXPECT_TRUE(json["held_out"]["before_without_suspects"].contains("rms_mm"));
  EXPECT_TRUE(json["held_out"]["after_without_suspects"].is_null());
}

}  // namespace
}  // namespace trammel
