#include "server/trainer/acceptance/judging.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "server/trainer/pipeline/train.h"
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

int count(const MeasurementBatch& batch, MeasurementSet set) {
  return static_cast<int>(std::count_if(batch.measurements.begin(), batch.measurements.end(),
                                        [set](const Measurement& m) { return m.set == set; }));
}

TEST(JudgingRows, AreAFifthAndOfAHundredPosesAtLeastThirtyFour) {
  EXPECT_EQ(judging_rows(batch_of(40), kShare, 1).size(), 8U);
  EXPECT_EQ(judging_rows(batch_of(100), kShare, 1).size(), 34U);
  EXPECT_EQ(judging_rows(batch_of(200), kShare, 1).size(), 40U);
  EXPECT_EQ(judging_rows(batch_of(200), kShare, 1), judging_rows(batch_of(200), kShare, 1));
  EXPECT_TRUE(judging_rows(batch_of(1), kShare, 1).empty()) << "one row at least stays for training";
}

TEST(JudgingRows, AreThoseThatAPlainSplitDraws) {
  const MeasurementBatch batch = batch_of(200);
  std::set<int> drawn;
  for (const Measurement& m : split_batch(batch, kShare, 7).validation.measurements) drawn.insert(m.row);
  EXPECT_EQ(judging_rows(batch, kShare, 7), drawn) << "models of before judge by the same rows";
}

TEST(JudgingRows, TheSubmitterHoldsOutMoreButDoesNotChooseThem) {
  MeasurementBatch batch = batch_of(60);
  for (int i = 0; i < 20; ++i) batch.measurements[static_cast<std::size_t>(i)].set = MeasurementSet::kValidation;
  const std::set<int> judges = judging_rows(batch, kShare, 1);
  EXPECT_EQ(judges.size(), 8U) << "a fifth of the other 40";
  for (int i = 0; i < 20; ++i) EXPECT_FALSE(judges.contains(i + 2));
  EXPECT_EQ(count(held_out_by_service(batch, kShare, 1), MeasurementSet::kTrain), 32);
}

TEST(JudgingRows, ACopyOfAJudgeIsNotLearnedFrom) {
  MeasurementBatch batch = batch_of(50);
  for (int i = 0; i < 50; ++i) {
    Measurement copy = batch.measurements[static_cast<std::size_t>(i)];
    copy.context.q.array() += 1e-6;
    copy.row += 50;
    batch.measurements.push_back(copy);
  }
  const MeasurementBatch held_out = held_out_by_service(batch, kShare, 1);
  EXPECT_EQ(judging_rows(batch, kShare, 1).size(), 20U) << "ten poses, each measured twice";
  for (std::size_t i = 0; i < 50; ++i) EXPECT_EQ(held_out.measurements[i].set, held_out.measurements[i + 50].set);
}

MeasurementBatch measured_batch(const std::string& id, int first, int last) {
  MeasurementBatch batch = batch_of(last);
  batch.measurements.erase(batch.measurements.begin(), batch.measurements.begin() + first);
  for (Measurement& m : batch.measurements) m.p_W = Vector3(1.2, 0.3, 0.01 * m.row);
  batch.id = id;
  return batch;
}

TEST(JudgingSessions, ARowThatIsSentAgainUnderAnotherIdJudgesOnceAndIsNotLearnedFrom) {
  const MeasurementBatch again = measured_batch("again", 10, 120);
  std::vector<JudgingSession> sessions = {judging_session(measured_batch("first", 0, 100), kShare, 1),
                                          judging_session(again, kShare, 1)};
  const MeasurementBatch first_judges = sessions[0].judges;
  judge_once(sessions);
  EXPECT_EQ(sessions[0].judges.measurements.size(), first_judges.measurements.size());
  for (const Measurement& m : sessions[1].judges.measurements) EXPECT_GE(m.row, 102) << "of the twenty new ones";
  EXPECT_FALSE(sessions[1].judges.measurements.empty());
  const MeasurementBatch learned = without_older_judges(held_out_by_service(again, kShare, 1), sessions);
  std::set<int> judges;
  for (const Measurement& m : first_judges.measurements) judges.insert(m.row);
  for (const Measurement& m : learned.measurements)
    EXPECT_TRUE(m.set != MeasurementSet::kTrain || !judges.contains(m.row)) << m.row;
  const MeasurementBatch first = held_out_by_service(measured_batch("first", 0, 100), kShare, 1);
  const MeasurementBatch kept = without_older_judges(first, sessions);
  EXPECT_EQ(count(kept, MeasurementSet::kTrain), count(first, MeasurementSet::kTrain));
}

TEST(JudgingSessions, TheSamePoseMeasuredAnotherTimeJudgesAgain) {
  MeasurementBatch later = measured_batch("later", 0, 100);
  for (Measurement& m : later.measurements) m.p_W.x() += 12e-6;
  std::vector<JudgingSession> sessions = {judging_session(measured_batch("first", 0, 100), kShare, 1),
                                          judging_session(later, kShare, 1)};
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
    return test::demand(
        check_against_cell(test::measured_on(robot, {.poses = 120, .seed = 3, .set_up_anew = anew}), *cell));
  };
  TrainOptions options;
  options.bias = "none";
  const CompensatedModel model = test::demand(train(cell, batch(false), options));
  const LocatedErrors here = located_errors(model, judging_session(batch(false), kShare, 1));
  const LocatedErrors there = located_errors(model, judging_session(batch(true), kShare, 1));
  ASSERT_EQ(here.position.cols(), 34);
  EXPECT_LT((here.position - there.position).cwiseAbs().maxCoeff(), 2e-6) << "gravity is turned a little";
  EXPECT_LT((here.rotation - there.rotation).cwiseAbs().maxCoeff(), 2e-6);
  EXPECT_LT(here.position.norm() / std::sqrt(34.0), 40e-6);
}

}  // namespace
}  // namespace trammel
