#include "clients/cli/text/diagnose_text.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "server/measurement/files/joint_list.h"
#include "server/report/diagnosis_json.h"
#include "tests/report/diagnosis_fixture.h"

namespace trammel::cli {
namespace {

TEST(DiagnoseText, TellsTheVerdictTheDoubtAndWhatToDo) {
  const std::string text = diagnosis_text(diagnosis_json(test::made_up_diagnosis(test::cell_7())));
  for (const char* part :
       {"ambiguous: The gear of joint 3", "gear ripple in joint 3", "order = 48.503 ± 0.040",
        "± is U(k=2): two standard uncertainties", "could also be: link geometry (d6)",
        "Have the gear of joint 3 looked at", "9 um rms. It changes with the position of joint 4",
        "pose p28 (row 29)",
        "would not have shown: backlash: needs both approach directions (joints 2)",
        "uncertain by more than the effect itself now, by 30 % of the effect with them"}) {
    EXPECT_NE(text.find(part), std::string::npos) << part << "\n" << text;
  }
  EXPECT_NE(text.find("gear_cos3 = 0.00112 ± 0.00011 deg"), std::string::npos) << text;
  EXPECT_EQ(text.find(" rad"), std::string::npos) << text;
}

TEST(DiagnoseText, WhereNothingIsMissingSaysThatThisIsBeyondTheModel) {
  Diagnosis diagnosis = test::made_up_diagnosis(test::cell_7());
  diagnosis.verdict = Verdict::kNothing;
  diagnosis.sentence = "The drawing is off by 21.1 mm rms.";
  const std::string text = diagnosis_text(diagnosis_json(diagnosis));
  EXPECT_TRUE(text.starts_with("nothing beyond the model: The drawing is off by 21.1 mm")) << text;
}

TEST(DiagnoseText, TellsTheSizeProvedBesideThePredictedOneAndHowFarTheOthersAreKnown) {
  Diagnosis diagnosis = test::made_up_diagnosis(test::cell_7());
  EXPECT_EQ(diagnosis_text(diagnosis_json(diagnosis)).find("Proved"), std::string::npos);
  diagnosis.proof = test::made_up_proof();
  const std::string text = diagnosis_text(diagnosis_json(diagnosis));
  for (const char* part :
       {"Proved in the residuals of this batch: named with 90 %", "27 um (24 um to 31 um)",
        "not named up to 90 um, found 9 of 9", "9 um or more, named 0 of 1",
        "for sure: 1 of 28 diagnoses", "nothing put in: 1 of 12", "1 of 3 causes are not decided"})
    EXPECT_NE(text.find(part), std::string::npos) << part << "\n" << text;
}

TEST(DiagnoseText, ALongListOfParametersIsNoLineThatNobodyReads) {
  Diagnosis diagnosis = test::made_up_diagnosis(test::cell_7());
  for (int k = 1; k <= 24; ++k)
    diagnosis.findings[0].parameters.push_back({fmt::format("number{}", k), "mm", 0.1, 0.01});
  const std::string text = diagnosis_text(diagnosis_json(diagnosis));
  const std::size_t at = text.find("number12"), begin = text.rfind('\n', at) + 1;
  EXPECT_LT(text.find('\n', at) - begin, 160U) << text;
}

TEST(DiagnoseText, TellsWhenAStepMayHaveBegunAndOnceWhatACauseNeeds) {
  Diagnosis diagnosis = test::made_up_diagnosis(test::cell_7());
  diagnosis.findings[0].may_begin_at = {{"p7", 8, 120.0}, {"p8", 9, {}}};
  const Cause payload = {"payload"};
  diagnosis.not_separable = {{{payload, {"compliance", -1, "C2", "", {}}}, 1},
                             {{payload, {"compliance", -1, "C3", "", {}}}, 1}};
  diagnosis.could_not_have_seen.push_back({payload, 0.9, 1e-5, {}, "a second known payload"});
  const std::string text = diagnosis_text(diagnosis_json(diagnosis));
  for (const char* part : {"may have begun at any of 2 poses from p7 (120 s) to p8 (95 %)",
                           "payload mass or centre of gravity from gearbox compliance (C2), "
                           "gearbox compliance (C3) (needs a second known payload)"}) {
    EXPECT_NE(text.find(part), std::string::npos) << part << "\n" << text;
  }
}

TEST(DiagnoseText, TellsOfNoLikenessOfWhatDoesNotShowAtAll) {
  Diagnosis diagnosis = test::made_up_diagnosis(test::cell_7());
  diagnosis.not_separable.push_back({{{"backlash", 1}, {"geometry", -1, "q2", "", {}}}, 1});
  const std::string text = diagnosis_text(diagnosis_json(diagnosis));
  EXPECT_EQ(text.find("not told apart by these poses: backlash"), std::string::npos) << text;
  EXPECT_NE(text.find("not told apart by these poses: tool"), std::string::npos) << text;
}

TEST(DiagnoseText, SaysWhatWouldNotHaveBeenNamedForCertainAndHowLargeTheNoiseIs) {
  Diagnosis diagnosis = test::made_up_diagnosis(test::cell_7());
  for (Measurement& m : diagnosis.batch.measurements) m.context.direction.clear();
  const std::string text = diagnosis_text(diagnosis_json(diagnosis));
  for (const char* part : {"150 poses. Noise: 22.5 um rms, what is left of a position when all "
                           "that was found is corrected",
                           "would not have been named for certain (looked for by the order of the "
                           "poses): backlash: needs both approach directions (joints 2)"}) {
    EXPECT_NE(text.find(part), std::string::npos) << part << "\n" << text;
  }
}

TEST(DiagnoseText, APoseThatMayShowWhatTheSimulationLacksIsNotCalledABadOne) {
  Diagnosis diagnosis = test::made_up_diagnosis(test::cell_7());
  Finding out{.cause = {.cause = "outlier", .pose_id = "p9"}, .effect_rms = 1e-3};
  diagnosis.findings = {out};
  EXPECT_NE(diagnosis_text(diagnosis_json(diagnosis)).find("single bad pose, pose p9"),
            std::string::npos);
  diagnosis.findings.front().could_also_be = {unknown_cause()};
  const std::string text = diagnosis_text(diagnosis_json(diagnosis));
  EXPECT_EQ(text.find("bad pose"), std::string::npos) << text;
  EXPECT_NE(text.find("pose that the simulation misses, pose p9"), std::string::npos) << text;
}

TEST(DiagnoseText, NextPosesAreAPlanThatTheOtherCommandsRead) {
  const Diagnosis diagnosis = test::made_up_diagnosis(test::cell_7());
  const JointList plan =
      test::demand(parse_joint_csv(next_poses_csv(diagnosis_json(diagnosis)), "next.csv"));
  ASSERT_EQ(plan.poses.size(), 10u);
  EXPECT_LT((plan.poses[4].context.q - diagnosis.next_poses.q[4]).norm(), 1e-9);
}

}  // namespace
}  // namespace trammel::cli
