// Tries batches that would make a good model worse, which it must outlive by itself, and
// batches that are a gain. Each is measured on the virtual robot: its true error before and after.
#include "server/tasks/accept/gate.h"

#include <gtest/gtest.h>

#include <set>

#include "server/base/units.h"
#include "server/base/unix_time.h"
#include "server/compensate/model_file.h"
#include "server/measurement/checked_batch.h"
#include "server/tasks/train/train.h"
#include "tests/support/demand.h"
#include "tests/support/learning_cell.h"

namespace trammel {
namespace {

using test::Day;
using test::LearningCell;
using test::measured_on;
using test::true_error;

class GateTest : public testing::Test {
 protected:
  GateTest() { use(*test::cell_7()); }
  void use(Cell cell) {
    cell.model.bias = "se";
    cell_ = std::make_shared<const Cell>(std::move(cell));
    robot_ = test::chapter_5_robot(cell_);
  }
  /// 200 poses over the whole range.
  MeasurementBatch first_day(const std::string& tool = {}) const {
    return measured_on(robot_, {.seed = 31, .tool = tool});
  }
  /// A good model is in force; `days` are submitted. Its true error must not grow.
  void expect_not_worse(const std::vector<MeasurementBatch>& days, const std::string& tool = {}) {
    LearningCell learning(cell_);
    const JobProgress first = learning.submit(first_day(tool));
    ASSERT_TRUE(first.in_force) << first.what;
    const double before = true_error(learning.model(), robot_, tool);
    EXPECT_LT(to_mm(before), 0.012);
    std::string what;
    for (const MeasurementBatch& day : days) what += learning.submit(day).what + "\n";
    const double after = true_error(learning.model(), robot_, tool);
    EXPECT_LE(after, std::max(1.15 * before, before + 1e-6)) << what;
  }
  [[nodiscard]] VirtualRobot with_joint_2_off(double rad) const {
    VirtualRobot changed = robot_;
    const std::vector<Parameter> parameters = changed.truth.parameters();
    for (std::size_t k = 0; k < parameters.size(); ++k) {
      if (parameters[k].name == "q2") changed.truth.values(static_cast<Eigen::Index>(k)) += rad;
    }
    return changed;
  }

  std::shared_ptr<const Cell> cell_;
  VirtualRobot robot_;
};

TEST_F(GateTest, ACornerMeasuredAfterTheTrackerWasSetUpElsewhereDoesNotReplaceAGoodModel) {
  expect_not_worse(
      {measured_on(robot_, {.poses = 25, .seed = 32, .corner = 0.3, .set_up_anew = true})});
}

TEST_F(GateTest, NoisierPosesOverTheWholeRangeDoNotReplaceAGoodModel) {
  expect_not_worse(
      {measured_on(robot_, {.poses = 100, .seed = 33, .noise = 1.45, .set_up_anew = true})});
}

TEST_F(GateTest, ASubmitterDoesNotChooseHisJudges) {
  MeasurementBatch corner = measured_on(robot_, {.poses = 40, .seed = 34, .corner = 0.3});
  const std::vector<Measurement> rows = corner.measurements;
  for (Measurement& m : corner.measurements) m.set = MeasurementSet::kTrain;
  for (Measurement copy : rows) {
    copy.pose_id = "copy-" + copy.pose_id;
    copy.set = MeasurementSet::kValidation;
    corner.measurements.push_back(std::move(copy));
  }
  expect_not_worse({corner});
}

TEST_F(GateTest, JudgesThatAreSentAgainAsABatchOfTheirOwnDoNotTeachTheirOwnAnswers) {
  const MeasurementBatch first = first_day();
  MeasurementBatch judges = test::demand(check_against_cell(first, *cell_)).rows();
  const std::set<int> rows =
      judging_rows(judges, TrainerOptions{}.validation_share, TrainerOptions{}.seed);
  std::erase_if(judges.measurements, [&](const Measurement& m) { return !rows.contains(m.row); });
  judges.source_text.clear();
  LearningCell learning(cell_);
  learning.submit(first);
  const JobProgress done = learning.submit(judges);
  EXPECT_FALSE(done.in_force) << done.what;
}

TEST_F(GateTest, AnArmThatWasIsNotLearnedAgainFromTheBatchesOfItsTime) {
  LearningCell learning(cell_);
  learning.submit(first_day());
  TrainOptions offline;
  offline.trained_at = unix_now();
  const CompensatedModel changed = test::demand(train(
      cell_, measured_on(with_joint_2_off(1e-3), {.poses = 120, .seed = 39, .set_up_anew = true}),
      offline));
  const int version =
      test::demand(learning.trainer().import_model(cell_->name, serialize(changed)));
  ASSERT_FALSE(learning.trainer().activate(cell_->name, version))
      << "it is worse on what was measured before";
  ASSERT_TRUE(learning.trainer().activate(cell_->name, version, {}, true))
      << "the arm has changed, and a person says so";
  const JobProgress again =
      learning.finished(test::demand(learning.trainer().retrain(cell_->name, {"day-1"}, "", "")));
  EXPECT_FALSE(again.in_force) << again.what;
  EXPECT_EQ(learning.in_force(), version);
}

TEST_F(GateTest, EverNoisierBatchesDoNotAddUpToAWorseModel) {
  std::vector<MeasurementBatch> days;
  for (const double noise : {1.35, 1.7, 2.05, 2.4, 2.75, 3.1}) {
    days.push_back(measured_on(robot_, {.poses = 60, .seed = 35 + days.size(), .noise = noise}));
  }
  expect_not_worse(days);
}

class TwoToolsTest : public GateTest {
 protected:
  TwoToolsTest() {
    const Cell one_tool = *test::cell_7();
    std::string text = one_tool.cell_yaml;
    const std::string tools = "\ntools:\n";
    text.insert(text.find(tools) + tools.size(),
                "  probe: {xyz_mm: [130, 50, 270], q_wxyz: [0.923879532511287, 0, "
                "-0.382683432365090, 0]}\n");
    use(test::demand(parse_cell(text, one_tool.robot_yaml, "cell.yaml")));
  }
};

TEST_F(TwoToolsTest, AnotherToolAloneDoesNotSpoilTheFirst) {
  expect_not_worse({measured_on(robot_, {.poses = 80, .seed = 36, .tool = "probe"})}, "spindle");
}

TEST_F(TwoToolsTest, ABatchThatShowsAChangedToolIsKeptOutThoughItTeachesAnotherToo) {
  LearningCell learning(cell_);
  learning.submit(first_day("spindle"));
  VirtualRobot bumped = robot_;
  bumped.truth.tools.at("spindle").translation() += Vector3(0.4e-3, 0, 0);
  MeasurementBatch day = measured_on(bumped, {.poses = 120, .seed = 43, .tool = "spindle"});
  Measurement other =
      measured_on(robot_, {.poses = 20, .seed = 44, .tool = "probe"}).measurements.front();
  other.pose_id = "another";
  day.measurements.push_back(std::move(other));
  const JobProgress done = learning.submit(day);
  EXPECT_EQ(done.stage, JobStage::kFailed) << done.what;
  EXPECT_NE(done.what.find("quarantine"), std::string::npos) << done.what;
  EXPECT_EQ(learning.in_force(), 1);
}

TEST_F(TwoToolsTest, AReleasedBatchJudgesFromThenOn) {
  LearningCell learning(cell_);
  learning.submit(first_day("spindle"));
  VirtualRobot bumped = robot_;
  bumped.truth.tools.at("spindle").translation() += Vector3(0.4e-3, 0, 0);
  const JobProgress kept_out =
      learning.submit(measured_on(bumped, {.poses = 120, .seed = 43, .tool = "spindle"}));
  ASSERT_EQ(kept_out.stage, JobStage::kFailed) << kept_out.what;
  Trainer& trainer = learning.trainer();
  const auto released =
      trainer.retrain(cell_->name, {"day-2"}, "", "", Trainer::Quarantine::kReleased);
  const JobProgress taken = learning.finished(test::demand(released));
  ASSERT_TRUE(taken.in_force) << taken.what;
  const JobProgress again =
      learning.finished(test::demand(trainer.retrain(cell_->name, {"day-1"}, "", "")));
  EXPECT_FALSE(again.in_force) << again.what;
  EXPECT_NE(again.what.find("held-out rms"), std::string::npos)
      << "held against day-2: " << again.what;
}

TEST_F(TwoToolsTest, ABatchOfAnotherToolAloneTeachesThatTool) {
  LearningCell learning(cell_);
  learning.submit(first_day("spindle"));
  const JobProgress done =
      learning.submit(measured_on(robot_, {.poses = 80, .seed = 36, .tool = "probe"}));
  EXPECT_TRUE(done.in_force) << done.what;
  EXPECT_TRUE(learning.model().check_trained_with("spindle", "spindle"));
  EXPECT_TRUE(learning.model().check_trained_with("probe", "spindle"));
}

TEST_F(GateTest, ManyGoodPosesAfterFewNoisyOnesGoInForceWhereverTheTrackerStands) {
  for (const bool anew : {false, true}) {
    LearningCell learning(cell_);
    learning.submit(measured_on(robot_, {.poses = 40, .seed = 37, .noise = 2}));
    const double before = true_error(learning.model(), robot_);
    const JobProgress done =
        learning.submit(measured_on(robot_, {.poses = 400, .seed = 38, .set_up_anew = anew}));
    EXPECT_TRUE(done.in_force) << done.what;
    EXPECT_LT(true_error(learning.model(), robot_), 0.5 * before);
  }
}

TEST_F(GateTest, AnArmThatHasChangedIsLearnedAnew) {
  const VirtualRobot changed = with_joint_2_off(1e-3);
  LearningCell learning(cell_);
  learning.submit(first_day());
  const JobProgress done =
      learning.submit(measured_on(changed, {.poses = 120, .seed = 39, .set_up_anew = true}));
  EXPECT_TRUE(done.in_force) << done.what;
  EXPECT_LT(to_mm(true_error(learning.model(), changed)), 0.02);
}

TEST_F(GateTest, TheOutcomeSaysBeforeAfterLimitAndWhy) {
  LearningCell learning(cell_);
  learning.submit(first_day());
  const JobProgress done =
      learning.submit(measured_on(robot_, {.poses = 100, .seed = 40, .noise = 1.45}));
  EXPECT_FALSE(done.in_force);
  for (const char* part :
       {"not in force", "held-out rms", "before", "(version 1)", "limit", "activate"})
    EXPECT_NE(done.what.find(part), std::string::npos) << part << " in: " << done.what;
}

TEST_F(GateTest, FewJudgesLeaveItToAPerson) {
  LearningCell learning(cell_);
  learning.submit(measured_on(robot_, {.poses = 40, .seed = 41, .noise = 2}));
  const JobProgress done = learning.submit(measured_on(robot_, {.poses = 60, .seed = 42}));
  EXPECT_FALSE(done.in_force) << done.what;
  EXPECT_NE(done.what.find("30 are needed"), std::string::npos) << done.what;
  EXPECT_TRUE(learning.trainer().activate(cell_->name, done.model_version));
}

/// Judged without a trainer.
class JudgeTest : public GateTest {
 protected:
  [[nodiscard]] CheckedBatch day(const Day& day) const {
    MeasurementBatch batch = measured_on(robot_, day);
    batch.id = fmt::format("day-{}", day.seed);
    return test::demand(check_against_cell(std::move(batch), *cell_, held_out_by_service(0.2, 1)));
  }
  [[nodiscard]] JudgingSession session(const Day& of) const { return judging_session(day(of)); }
  [[nodiscard]] CompensatedModel trained(const Day& of) const {
    TrainOptions options;
    options.bias = "none";
    return test::demand(train(cell_, day(of), options));
  }
};

TEST_F(JudgeTest, WithoutAnyPoseHeldOutNothingGoesInForce) {
  const CompensatedModel model = trained({.seed = 1});
  EXPECT_FALSE(judge({model, nullptr, {}, {}, 0}, {}).put_in_force);
}

TEST_F(JudgeTest, NothingThatIsWorseThanWhatServedBeforeGoesInForce) {
  const ServedModel best{cell_->name, 1, trained({.seed = 1})};
  const ServedModel worst{cell_->name, 2, trained({.poses = 40, .seed = 2, .noise = 4})};
  const CompensatedModel middle = trained({.poses = 60, .seed = 3, .noise = 2});
  const std::vector<JudgingSession> sessions = {session({.poses = 400, .seed = 1})};
  EXPECT_TRUE(judge({middle, &worst, {}, sessions, 0}, {}).put_in_force);
  const GateVerdict held = judge({middle, &worst, {best}, sessions, 0}, {});
  EXPECT_FALSE(held.put_in_force);
  EXPECT_NE(held.message.find("version 1 has"), std::string::npos) << held.message;
}

TEST_F(JudgeTest, WhereTheNewestSessionsDoNotFitOnlyTheyJudge) {
  const ServedModel present{cell_->name, 1, trained({.seed = 1})};
  const JudgingSession old = session({.seed = 1}), later = session({.seed = 2});
  robot_ = with_joint_2_off(1e-3);
  const JudgingSession changed = session({.seed = 3}), again = session({.seed = 4});
  const auto today = [&](const std::vector<JudgingSession>& sessions, std::size_t first_new) {
    std::vector<std::string> ids;
    for (const JudgingSession& one :
         sessions_of_today({present.model, &present, {}, sessions, first_new}))
      ids.push_back(one.batch_id);
    return ids;
  };
  EXPECT_EQ(today({old, later}, 1), (std::vector<std::string>{"day-1", "day-2"}));
  EXPECT_EQ(today({old, changed, again}, 1), (std::vector<std::string>{"day-3", "day-4"}));
  EXPECT_EQ(today({changed, old, later}, 2), (std::vector<std::string>{"day-1", "day-2"}))
      << "an arm that was";
  EXPECT_EQ(today({old, changed, later}, 1), (std::vector<std::string>{"day-1", "day-2"}))
      << "one bad day";
}

}  // namespace
}  // namespace trammel
