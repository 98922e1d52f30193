#include "clients/cli/diagnose_text.h"

#include <gtest/gtest.h>

#include "server/measurement/joint_list.h"
#include "server/report/diagnosis_json.h"
#include "tests/report/diagnosis_fixture.h"

namespace trammel::cli {
namespace {

TEST(DiagnoseText, TellsTheVerdictTheDoubtAndWhatToDo) {
  const std::string text = diagnosis_text(diagnosis_json(test::made_up_diagnosis(test::cell_7())));
  for (const char* part :
       {"ambiguous: The gear of joint 3", "gear_transmission of joint 3", "order = 48.503 ± 0.040",
        "half of the 95 % interval", "could also be: geometry d6", "Have the gear of joint 3 looked at",
        "9 um rms that depend on q4", "pose p28 (row 29)",
        "would not have shown: backlash: needs both approach directions (joints 2)", "uncertainty 2.4 now, 0.3"}) {
    EXPECT_NE(text.find(part), std::string::npos) << part << "\n" << text;
  }
}

TEST(DiagnoseText, NextPosesAreAPlanThatTheOtherCommandsRead) {
  const Diagnosis diagnosis = test::made_up_diagnosis(test::cell_7());
  const JointList plan = test::demand(parse_joint_csv(next_poses_csv(diagnosis_json(diagnosis)), "next.csv"));
  ASSERT_EQ(plan.poses.size(), 10u);
  EXPECT_LT((plan.poses[4].context.q - diagnosis.next_poses.q[4]).norm(), 1e-9);
}

}  // namespace
}  // namespace trammel::cli
