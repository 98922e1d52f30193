#include "server/tasks/accept/judging.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "server/measurement/split.h"
#include "server/tasks/train/train.h"
#include "tests/support/demand.h"
#include "tests/support/learning_cell.h"

namespace trammel {
namespace {

constexpr double kShare = 0.2;

MeasurementBatch batch_of(int poses) {
  MeasurementBatch batch;
  for (int i = 0; i < poses; ++i) {
    Measurement m;
    m.pose_id = std::to_string(i + 1);
    m.row = i + 2;
    m.context.q = JointVector::Constant(6, 0.01 * i);
    batch.measurements.push_back(std::move(m));
  }
  return batch;
}

TEST(JudgingRows, AreAFifthAndOfAHundredPosesAtLeastThirtyFour) {
  EXPECT_EQ(judging_rows(batch_of(40), kShare, 1).size(), 8U);
  EXPECT_EQ(judging_rows(batch_of(100), kShare, 1).size(), 34U);
  EXPECT_EQ(judging_rows(batch_of(200), kShare, 1).size(), 40U);
  EXPECT_EQ(judging_rows(batch_of(200), kShare, 1), judging_rows(batch_of(200), kShare, 1));
  EXPECT_EQ(judging_rows(batch_of(8), kShare, 1).size(), 2U);
  EXPECT_TRUE(judging_rows(batch_of(7), kShare, 1).empty())
      << "each of a few poses is needed to learn from";
}

TEST(JudgingRows, AreThoseThatAPlainSplitDraws) {
  const MeasurementBatch batch = batch_of(200);
  std::set<int> drawn;
  for (const Measurement& m : split_batch(batch, kShare, 7).validation.measurements)
    drawn.insert(m.row);
  EXPECT_EQ(judging_rows(batch, kShare, 7), drawn) << "models of before judge by the same rows";
}

TEST(JudgingRows, TheSubmitterHoldsOutMoreButDoesNotChooseThem) {
  MeasurementBatch batch = batch_of(60);
  for (int i = 0; i < 20; ++i)
    batch.measurements[static_cast<std::size_t>(i)].set = MeasurementSet::kValidation;
  const std::set<int> judges = judging_rows(batch, kShare, 1);
  EXPECT_EQ(judges.size(), 8U) << "a fifth of the other 40";
  for (int i = 0; i < 20; ++i) EXPECT_FALSE(judges.contains(i + 2));
  const std::vector<bool> held_out = held_out_by_service(kShare, 1)(batch);
  EXPECT_EQ(std::count(held_out.begin(), held_out.end(), false), 32);
}

TEST(JudgingRows, ACopyOfAJudgeIsNotLearnedFrom) {
  MeasurementBatch batch = batch_of(50);
  for (int i = 0; i < 50; ++i) {
    Measurement copy = batch.measurements[static_cast<std::size_t>(i)];
    copy.context.q.array() += 1e-6;
    copy.row += 50;
    batch.measurements.push_back(copy);
  }
  const std::vector<bool> held_out = held_out_by_service(kShare, 1)(batch);
  EXPECT_EQ(judging_rows(batch, kShare, 1).size(), 20U) << "ten poses, each measured twice";
  for (std::size_t i = 0; i < 50; ++i) EXPECT_EQ(held_out[i], held_out[i + 50]);
}

/// Rows `first` to `last` of one day of the shipped robot, as a batch of their own.
MeasurementBatch part_of_a_day(const std::string& id, int first, int last) {
  static const MeasurementBatch day = test::measured(test::chapter_5_robot(test::cell_7()), 120, 3);
  MeasurementBatch batch = day;
  batch.id = id;
  batch.measurements.assign(day.measurements.begin() + first, day.measurements.begin() + last);
  return batch;
}

CheckedBatch accepted(const MeasurementBatch& batch) {
  return test::demand(check_against_cell(batch, *test::cell_7(), held_out_by_service(kShare, 1)));
}

std::set<int> rows_of(const MeasurementBatch& batch) {
  std::set<int> rows;
  for (const Measurement& m : batch.measurements) rows.insert(m.row);
  return rows;
}

TEST(JudgingSessions, ARowThatIsSentAgainUnderAnotherIdJudgesOnceAndIsNotLearnedFrom) {
  const CheckedBatch first = accepted(part_of_a_day("first", 0, 100));
  const CheckedBatch again = accepted(part_of_a_day("again", 10, 120));
  std::vector<JudgingSession> sessions = {judging_session(first), judging_session(again)};
  const std::set<int> first_judges = rows_of(sessions[0].judges);
  const std::set<int> sent_twice = rows_of(first.rows());
  judge_once(sessions);
  EXPECT_EQ(rows_of(sessions[0].judges), first_judges);
  for (const int row : rows_of(sessions[1].judges))
    EXPECT_FALSE(sent_twice.contains(row)) << "of the twenty new ones";
  EXPECT_FALSE(sessions[1].judges.measurements.empty());
  for (const int row : rows_of(without_older_judges(again, sessions).training()))
    EXPECT_FALSE(first_judges.contains(row)) << row;
  EXPECT_EQ(rows_of(without_older_judges(first, sessions).training()), rows_of(first.training()));
}

TEST(JudgingSessions, TheSamePoseMeasuredAnotherTimeJudgesAgain) {
  MeasurementBatch later = part_of_a_day("later", 0, 100);
  for (Measurement& m : later.measurements) m.p_W.x() += 12e-6;
  std::vector<JudgingSession> sessions = {judging_session(accepted(part_of_a_day("first", 0, 100))),
                                          judging_session(accepted(later))};
  judge_once(sessions);
  EXPECT_EQ(sessions[1].judges.measurements.size(), 34U);
}

TEST(Coverage, IsOfTheJointWhereItIsLeastAndNoSinglePoseWidensIt) {
  const JointVector low = JointVector::Constant(6, -1), high = JointVector::Constant(6, 1);
  std::vector<JointVector> poses;
  for (int i = 0; i <= 100; ++i) poses.push_back(JointVector::Constant(6, -1 + 0.02 * i));
  EXPECT_NEAR(coverage(poses, low, high), 1, 1e-9);
  for (JointVector& q : poses) q(3) *= 0.3;
  EXPECT_NEAR(coverage(poses, low, high), 0.3, 1e-9);
  poses.push_back(high);
  poses.push_back(low);
  EXPECT_NEAR(coverage(poses, low, high), 0.3, 0.02);
  EXPECT_EQ(coverage({}, low, high), 0);
}

TEST(LocatedErrors, DoNotDependOnWhereTheTrackerStood) {
  const auto cell = test::cell_7();
  const VirtualRobot robot = test::chapter_5_robot(cell);
  const auto batch = [&](bool anew) {
    return accepted(test::measured_on(robot, {.poses = 120, .seed = 3, .set_up_anew = anew}));
  };
  TrainOptions options;
  options.bias = "none";
  const CompensatedModel model = test::demand(train(cell, batch(false).rows(), options));
  const LocatedErrors here = located_errors(model, judging_session(batch(false)));
  const LocatedErrors there = located_errors(model, judging_session(batch(true)));
  ASSERT_EQ(here.position.cols(), 34);
  EXPECT_LT((here.position - there.position).cwiseAbs().maxCoeff(), 2e-6)
      << "gravity is turned a little";
  EXPECT_LT((here.rotation - there.rotation).cwiseAbs().maxCoeff(), 2e-6);
  EXPECT_LT(here.position.norm() / std::sqrt(34.0), 40e-6);
}

}  // namespace
}  // namespace trammel
