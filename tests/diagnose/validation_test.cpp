#include "server/diagnose/validation.h"

#include <gtest/gtest.h>

#include "tests/support/demand.h"
#include "tests/support/diagnosis_trial.h"
#include "tests/support/hidden_columns.h"

namespace trammel {
namespace {

DiagnoseOptions quick() {
  DiagnoseOptions options;
  options.draws = 200;
  options.next_poses = 0;
  options.recovery = false;
  return options;
}

hidden::HiddenCase with_validation(std::uint64_t seed) {
  return hidden::hide({.kind = "backlash", .seed = seed, .lambda = 200, .poses = 160, .validation_share = 0.3});
}

std::vector<std::string> held_out_suspects(const Diagnosis& diagnosis) {
  std::vector<std::string> ids;
  for (const SuspectedPose& pose : diagnosis.suspects) {
    if (pose.held_out) ids.push_back(pose.pose_id);
  }
  return ids;
}

TEST(Validation, ListsAHeldOutPoseThatFitsNeitherModelAndDropsItFromNoFigure) {
  hidden::HiddenCase hidden = with_validation(6);
  int row = 0;
  while (!hidden.world.poses[static_cast<std::size_t>(row)].validation) ++row;
  hidden.batch_csv = hidden::with_added(hidden.batch_csv, "z_mm", row, 0.8);
  const Diagnosis diagnosis = test::demand(test::diagnose_files(hidden, quick()));
  EXPECT_EQ(held_out_suspects(diagnosis), std::vector<std::string>{fmt::format("p{}", row + 1)});
  ASSERT_TRUE(diagnosis.held_out_before_without && diagnosis.held_out_after_without);
  EXPECT_LT(diagnosis.held_out_after_without->max, 0.2e-3);
  EXPECT_GT(diagnosis.held_out_after->max, 0.6e-3) << "it still counts";
  EXPECT_NE(diagnosis.sentence.find("neither model"), std::string::npos) << diagnosis.sentence;
}

TEST(Validation, SuspectsNoGoodPose) {
  int suspected = 0;
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    const Diagnosis diagnosis = test::demand(test::diagnose_files(with_validation(seed), quick()));
    suspected += static_cast<int>(held_out_suspects(diagnosis).size());
    EXPECT_FALSE(diagnosis.held_out_after_without && held_out_suspects(diagnosis).empty());
  }
  EXPECT_EQ(suspected, 0);
}

}  // namespace
}  // namespace trammel
