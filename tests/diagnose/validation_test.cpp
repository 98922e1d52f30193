#include "server/diagnose/evidence/validation.h"

#include <gtest/gtest.h>

#include "server/measurement/checked_batch.h"
#include "tests/support/demand.h"
#include "tests/support/diagnosis_trial.h"
#include "tests/support/hidden_columns.h"
#include "tests/support/virtual_robot.h"

namespace trammel::cause_search {
namespace {

DiagnoseOptions quick() {
  DiagnoseOptions options;
  options.draws = 200;
  options.next_poses = 0;
  options.recovery = false;
  return options;
}

hidden::HiddenCase with_validation(std::uint64_t seed) {
  return hidden::hide(
      {.kind = "backlash", .seed = seed, .lambda = 200, .poses = 160, .validation_share = 0.3});
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

TEST(Validation, SuspectsAGoodPoseInOneOfAHundredBatches) {
  const auto cell = test::cell_7();
  const auto batch = [&](int poses, std::uint64_t seed) {
    return test::demand(
               check_against_cell(test::measured(test::chapter_5_robot(cell), poses, seed), *cell))
        .rows();
  };
  const MeasurementBatch seen = batch(80, 3);
  const CalibrationResult calibration =
      test::demand(calibrate(cell, cell->model.error_sources, seen, {}));
  std::vector<Parameter> priors;
  for (const IdentifiedParameter& one : calibration.parameters) priors.push_back(one.parameter);
  const LinearProblem problem(calibration.model, seen, priors, {});
  int suspected = 0;
  for (std::uint64_t seed = 100; seed < 200; ++seed) {
    const Validation validation = validate(problem, problem, batch(40, seed));
    suspected += validation.fit_neither.empty() ? 0 : 1;
    EXPECT_EQ(validation.after_without.has_value(), !validation.fit_neither.empty());
  }
  EXPECT_LE(suspected, 4);
}

}  // namespace
}  // namespace trammel::cause_search
