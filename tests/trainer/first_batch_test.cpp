#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "tests/support/demand.h"
#include "tests/support/learning_cell.h"

// The daemon looks at the first batch of a cell, too, before it learns from it.
namespace trammel {
namespace {

using test::LearningCell;

MeasurementBatch measured(std::uint64_t seed) {
  return test::measured(test::chapter_5_robot(test::cell_7()), 60, seed);
}

TEST(FirstBatch, OneThatWasReadWronglyIsKeptOutAndTheReadingThatFitsIsNamed) {
  LearningCell cell(test::cell_7());
  MeasurementBatch mirrored = measured(1);
  for (Measurement& m : mirrored.measurements) m.p_W.y() *= -1;
  const JobProgress job = cell.submit(std::move(mirrored));
  EXPECT_EQ(job.outcome.verdict, JobVerdict::kQuarantined) << job.what;
  EXPECT_NE(job.what.find("read with the other sign of y_mm they would fit"), std::string::npos)
      << job.what;
  EXPECT_EQ(cell.in_force(), 0) << "nothing is learned";
  const auto kept_out = test::demand(cell.trainer().quarantined("cell-7"));
  ASSERT_EQ(kept_out.size(), 1u) << "the batch is stored";
  EXPECT_EQ(kept_out.front().id, "day-1");

  EXPECT_EQ(cell.submit(measured(2)).outcome.verdict, JobVerdict::kInForce)
      << "the same as it was meant";
}

TEST(FirstBatch,
     OneOfAnotherToolIsLearnedOnceSomebodyWhoKnowsHasReleasedItAndWaitsForHimToActivateIt) {
  auto without_bias = std::make_shared<Cell>(*test::cell_7());
  without_bias->model.bias = "none";
  LearningCell cell(without_bias);
  MeasurementBatch other = measured(3);
  for (Measurement& m : other.measurements) m.p_W += *m.R_WT * Vector3(0, 0, 0.03);
  const JobProgress job = cell.submit(std::move(other));
  EXPECT_EQ(job.outcome.verdict, JobVerdict::kQuarantined) << job.what;
  EXPECT_NE(job.what.find("another point of the tool"), std::string::npos) << job.what;
  const auto again = test::demand(
      cell.trainer().retrain("cell-7", {"day-1"}, "", "", Trainer::Quarantine::kReleased));
  EXPECT_EQ(cell.finished(again).outcome.verdict, JobVerdict::kUndecided)
      << cell.finished(again).what;
  EXPECT_NE(cell.finished(again).what.find("no robot is so far off its drawing"),
            std::string::npos);
  EXPECT_EQ(cell.in_force(), 0);
}

TEST(FirstBatch, OneInWhichSomethingJumpsHalfwayIsKeptOutWithItsPose) {
  const auto nominal = test::cell_7();
  LearningCell cell(nominal);
  const VirtualRobot robot = test::chapter_5_robot(nominal);
  MeasurementBatch batch = test::measured_on(robot, {.poses = 120, .seed = 7});
  const MeasurementBatch later =
      test::measured_on(test::with_zero_off(robot, 3, 1e-3), {.poses = 120, .seed = 7});
  std::copy(later.measurements.begin() + 60, later.measurements.end(),
            batch.measurements.begin() + 60);
  const std::string pose = batch.measurements[60].pose_id;
  const JobProgress job = cell.submit(std::move(batch));
  EXPECT_EQ(job.outcome.verdict, JobVerdict::kQuarantined) << job.what;
  EXPECT_NE(job.what.find("from pose " + pose), std::string::npos) << job.what;
  EXPECT_NE(job.what.find("lost zero in joint 3"), std::string::npos) << job.what;
  EXPECT_NE(job.what.find("mm rms"), std::string::npos) << job.what;
  EXPECT_EQ(cell.in_force(), 0) << "nothing is learned";
}

TEST(FirstBatch, AModelThatLeavesHundredsOfSigmaWaitsForAPerson) {
  auto without_bias = std::make_shared<Cell>(*test::cell_7());
  without_bias->model.bias = "none";
  LearningCell cell(without_bias);
  MeasurementBatch bent = measured(8);  // as no cause bends it
  for (Measurement& m : bent.measurements) {
    const JointVector& q = m.context.q;
    m.p_W += 2e-3 * Vector3(std::sin(7 * q(1)), std::cos(6 * q(2)), std::sin(8 * q(0)));
  }
  const JobProgress job = cell.submit(std::move(bent));
  EXPECT_EQ(cell.in_force(), 0) << job.what;
  EXPECT_EQ(job.outcome.verdict, JobVerdict::kUndecided) << job.what;
  EXPECT_NE(job.outcome.why.find("times the stated sigma is left"), std::string::npos)
      << job.outcome.why;
}

/// Three rows in ten are off by some 30 mm.
MeasurementBatch doubtful(std::uint64_t seed) {
  MeasurementBatch bad = measured(seed);
  for (std::size_t i = 0; i < bad.measurements.size(); ++i) {
    const auto k = static_cast<double>(i);
    if (i % 10 < 3)
      bad.measurements[i].p_W += 0.03 * Vector3(std::sin(7 * k), std::cos(5 * k), std::sin(3 * k));
  }
  return bad;
}

TEST(FirstBatch, ADoubtfulOneHoldsUpNoLaterBatchAndCountsOnceAPersonActivatesItsModel) {
  auto without_bias = std::make_shared<Cell>(*test::cell_7());
  without_bias->model.bias = "none";
  LearningCell cell(without_bias);
  const auto learned = [&] {
    std::set<std::string> ids;
    for (const StoredBatch& batch : test::demand(cell.trainer().batches("cell-7")))
      if (batch.learned) ids.insert(batch.id);
    return ids;
  };
  const JobProgress waits = cell.submit(doubtful(8));
  ASSERT_EQ(waits.outcome.verdict, JobVerdict::kUndecided) << waits.what;
  EXPECT_EQ(waits.outcome.held_back, HeldBack::kStopNote);
  EXPECT_EQ(learned(), std::set<std::string>());

  const JobProgress good = cell.submit(measured(2));
  EXPECT_EQ(good.outcome.verdict, JobVerdict::kInForce) << good.what;
  EXPECT_EQ(good.outcome.held_back, HeldBack::kNo);
  EXPECT_EQ(cell.version(2).provenance().batch_id, "day-2");
  EXPECT_EQ(learned(), std::set<std::string>{"day-2"});

  ASSERT_TRUE(cell.trainer().activate("cell-7", 1, {}, true));
  EXPECT_EQ(learned(), (std::set<std::string>{"day-1", "day-2"}));
  ASSERT_TRUE(cell.trainer().activate("cell-7", 2));
  const JobProgress later = cell.submit(measured(3));
  EXPECT_EQ(cell.version(3).provenance().batch_id, "day-1+day-2+day-3") << later.what;
}

TEST(FirstBatch, ThreeBadRowsInTenAreNamedAndAPersonDecides) {
  auto without_bias = std::make_shared<Cell>(*test::cell_7());
  without_bias->model.bias = "none";
  LearningCell cell(without_bias);
  const JobProgress job = cell.submit(doubtful(8));
  EXPECT_EQ(cell.in_force(), 0) << job.what;
  EXPECT_EQ(job.outcome.verdict, JobVerdict::kUndecided) << job.what;
  EXPECT_NE(job.outcome.why.find("of the measured rows do not fit the others"), std::string::npos)
      << job.outcome.why;
}

TEST(FirstBatch, ALaterOneThatWasReadWronglyIsNamedLikewise) {
  LearningCell cell(test::cell_7());
  ASSERT_EQ(cell.submit(measured(4)).outcome.verdict, JobVerdict::kInForce);
  MeasurementBatch shifted = measured(5);
  for (std::size_t i = 0; i + 1 < shifted.measurements.size(); ++i) {
    shifted.measurements[i].p_W = shifted.measurements[i + 1].p_W;
    shifted.measurements[i].R_WT = shifted.measurements[i + 1].R_WT;
  }
  const JobProgress job = cell.submit(std::move(shifted));
  EXPECT_EQ(job.outcome.verdict, JobVerdict::kQuarantined) << job.what;
  EXPECT_NE(job.what.find("of the next row"), std::string::npos) << job.what;
}

}  // namespace
}  // namespace trammel
