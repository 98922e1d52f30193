#include "server/measurement/measurement.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <set>

#include "server/base/units.h"
#include "server/measurement/checked_batch.h"
#include "server/measurement/split.h"
#include "tests/support/refusal.h"

namespace trammel {
namespace {

using test::Refusal;
using test::refusal_of;

Joint make_joint(double theta_deg, double d, double a, double alpha_deg, double lower_deg,
                 double upper_deg) {
  Joint joint;
  joint.link = {from_deg(theta_deg), d, a, from_deg(alpha_deg), 0};
  joint.lower = from_deg(lower_deg);
  joint.upper = from_deg(upper_deg);
  return joint;
}

/// Six joints of a robot with 2.7 m reach, its base somewhere in W.
Cell make_cell(std::optional<Pose> X_FT) {
  Cell cell;
  cell.name = "cell-7";
  cell.robot =
      Chain::make("six axes",
                  {make_joint(0, .78, .32, -90, -170, 170), make_joint(-90, 0, 1.28, 0, -65, 85),
                   make_joint(0, 0, .2, -90, -180, 70), make_joint(180, 1.142, 0, -90, -300, 300),
                   make_joint(0, 0, 0, 90, -120, 120), make_joint(0, .2, 0, 0, -360, 360)})
          .value();
  cell.tools["spindle"] = std::move(X_FT);
  cell.payloads["spindle"] = Payload{};
  return cell;
}

Cell make_cell() { return make_cell(make_pose(Matrix3::Identity(), Vector3(.06, -.19, .17))); }

/// A tracker's view of `poses` random poses whose joints fill `share` of a quarter turn each.
MeasurementBatch make_batch(const Cell& cell, int poses, double share, const Vector3& p_FT) {
  MeasurementBatch batch;
  batch.id = "lt-07";
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> angle(-share * kPi / 3, share * kPi / 3);
  const Pose X_WB = make_pose(rotation_exp(Vector3(.1, .2, 2)), Vector3(3, -2, .5));
  for (int i = 0; i < poses; ++i) {
    Measurement m;
    m.pose_id = fmt::format("{}", i + 1);
    m.row = i + 2;
    m.context.q = JointVector::NullaryExpr(6, [&](Eigen::Index) { return angle(random); });
    m.p_W = X_WB * (cell.robot.flange_pose(m.context.q) * p_FT) + Vector3(.002, -.001, .001);
    batch.measurements.push_back(m);
  }
  return batch;
}

const Vector3 kTool(.06, -.19, .17);

Refusal refusal(const MeasurementBatch& batch, const Cell& cell) {
  const auto checked = check_against_cell(batch, cell);
  return refusal_of(checked);
}

MeasurementBatch in_radians(MeasurementBatch batch) {
  for (Measurement& m : batch.measurements) m.context.q *= from_deg(1);  // radians read as degrees
  return batch;
}

MeasurementBatch scaled(MeasurementBatch batch, double factor) {
  for (Measurement& m : batch.measurements) m.p_W *= factor;
  return batch;
}

TEST(CheckAgainstCell, ResolvesTheOnlyToolAndPayload) {
  const Cell cell = make_cell();
  const auto checked = check_against_cell(make_batch(cell, 20, 1, kTool), cell);
  ASSERT_TRUE(checked) << checked.error().message;
  EXPECT_EQ(checked->rows().measurements[0].context.tool, "spindle");
  EXPECT_EQ(checked->rows().measurements[0].context.payload, "spindle");
}

TEST(CheckAgainstCell, RefusesABatchWithoutMeasurements) {
  EXPECT_EQ(refusal(MeasurementBatch{}, make_cell()), Refusal("batch ").beyond(0, 1));
}

TEST(CheckAgainstCell, RefusesAnotherNumberOfJoints) {
  const auto batch = parse_batch_csv(
      "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,x_mm,y_mm,z_mm\n1,2,3,4,5,6,7,8\n", "b.csv");
  EXPECT_EQ(refusal(batch.value(), make_cell()), Refusal("b.csv").beyond(5, 6));
}

TEST(CheckAgainstCell, RefusesAJointOutsideItsLimitsWithRowValueAndLimit) {
  const Cell cell = make_cell();
  MeasurementBatch batch = make_batch(cell, 20, 1, kTool);
  batch.measurements[10].context.q(2) = from_deg(241.2);
  EXPECT_EQ(refusal(batch, cell), Refusal("batch lt-07", 12, "q3_deg").beyond(241.2, 70));
  batch.where = "data/lt-07.csv";
  EXPECT_EQ(refusal(batch, cell), Refusal("data/lt-07.csv", 12, "q3_deg").beyond(241.2, 70));
}

TEST(CheckAgainstCell, ToleratesALimitThatTheFileRounded) {
  const Cell cell = make_cell();
  MeasurementBatch batch = make_batch(cell, 1, 1, kTool);
  batch.measurements[0].context.q(2) = from_deg(70.00001);
  EXPECT_EQ(refusal(batch, cell), Refusal::none());
}

TEST(CheckAgainstCell, RefusesUnknownAndUndecidedTools) {
  Cell cell = make_cell();
  MeasurementBatch batch = make_batch(cell, 3, 1, kTool);
  cell.tools["probe"] = Pose::Identity();
  EXPECT_EQ(refusal(batch, cell), Refusal("batch lt-07", 2, "tool_id"));
  for (Measurement& m : batch.measurements) m.context.tool = "spindle";
  EXPECT_EQ(refusal(batch, cell), Refusal::none());
  batch.measurements[1].context.tool = "saw";
  EXPECT_EQ(refusal(batch, cell), Refusal("batch lt-07", 3, "tool_id").text("saw"));
  batch.measurements[1].context.tool = "spindle";
  batch.measurements[2].context.payload = "anvil";
  EXPECT_EQ(refusal(batch, cell), Refusal("batch lt-07", 4, "payload_id").text("anvil"));
}

/// Whose columns are in question where the spreads do not fit; both spreads stand in the data.
std::string suspected(const MeasurementBatch& batch, const Cell& cell) {
  const auto checked = check_against_cell(batch, cell);
  if (checked) return "nothing";
  EXPECT_EQ(checked.error().file, "batch lt-07");
  EXPECT_TRUE(checked.error().value && checked.error().limit && !checked.error().next.empty());
  return checked.error().field;
}

TEST(CheckAgainstCell, TakesJointsInRadiansForWhatTheyAreAndNamesBothSpreads) {
  const Cell cell = make_cell();
  EXPECT_EQ(suspected(in_radians(make_batch(cell, 50, 1, kTool)), cell), "q1_deg");
}

TEST(CheckAgainstCell, FindsRadiansInASmallRangeAndWithAnUnknownTool) {
  const Cell cell = make_cell();
  EXPECT_EQ(suspected(in_radians(make_batch(cell, 50, .1, kTool)), cell), "q1_deg");
  EXPECT_EQ(suspected(in_radians(make_batch(cell, 50, 1, kTool)), make_cell(std::nullopt)),
            "q1_deg");
}

TEST(CheckAgainstCell, FindsMetresAndCentimetresForMillimetres) {
  const Cell cell = make_cell();
  const MeasurementBatch batch = make_batch(cell, 50, 1, kTool);
  for (const double factor : {1e-3, .1, 10., 1e3})
    EXPECT_EQ(suspected(scaled(batch, factor), cell), "x_mm") << factor;
}

TEST(CheckAgainstCell, AcceptsSmallAndUniformBatches) {
  const Cell cell = make_cell();
  for (const int poses : {1, 2, 3, 10}) {
    for (const double share : {1., .05, .01, 0.}) {
      const MeasurementBatch batch = make_batch(cell, poses, share, kTool);
      EXPECT_EQ(refusal(batch, cell), Refusal::none()) << poses << " poses, share " << share;
      EXPECT_EQ(refusal(batch, make_cell(std::nullopt)), Refusal::none())
          << poses << " poses, share " << share;
    }
  }
}

TEST(CheckAgainstCell, AcceptsAnUnknownToolThatTurnsAboutAFixedPoint) {
  // Pivoting: the flange moves on a sphere about the tool point, which stays. No spread is
  // measured.
  Cell cell = make_cell(std::nullopt);
  Joint turn;
  turn.link = {0, 0, 0, from_deg(90), 0};
  const Vector3 p_FT(0, 0, -.4);
  Joint last = turn;
  last.link = {0, .4, 0, 0, 0};
  cell.robot = Chain::make("wrist", {turn, turn, turn, turn, turn, last}).value();
  EXPECT_EQ(refusal(make_batch(cell, 50, 1, p_FT), cell), Refusal::none());
}

TEST(CheckAgainstCell, KnowsHowFarALongToolSwingsWhenOnlyTheWristMoves) {
  const Vector3 p_FT(0, 3, 0);
  const Cell cell = make_cell(make_pose(Matrix3::Identity(), p_FT));
  MeasurementBatch batch = make_batch(cell, 50, 1, p_FT);
  for (Measurement& m : batch.measurements) {
    m.context.q.head<5>().setZero();
    m.p_W = cell.robot.flange_pose(m.context.q) * p_FT;
  }
  EXPECT_EQ(refusal(batch, cell), Refusal::none());
  EXPECT_NE(refusal(batch, make_cell(std::nullopt)), Refusal::none())
      << "half a metre is assumed where nothing is known";
}

TEST(CheckAgainstCell, AcceptsOneGrossOutlierAmongMany) {
  const Cell cell = make_cell();
  MeasurementBatch batch = make_batch(cell, 100, 1, kTool);
  batch.measurements[7].p_W += Vector3(5, 0, 0);
  EXPECT_EQ(refusal(batch, cell), Refusal::none());
}

std::vector<std::string> ids(const MeasurementBatch& batch) {
  std::vector<std::string> ids;
  for (const Measurement& m : batch.measurements) ids.push_back(m.pose_id);
  return ids;
}

TEST(SplitBatch, DrawsTheSameRowsForTheSameSeedAndOthersForAnother) {
  const MeasurementBatch batch = make_batch(make_cell(), 100, 1, kTool);
  const BatchSplit split = split_batch(batch, 0.2, 7);
  EXPECT_EQ(split.validation.measurements.size(), 20u);
  EXPECT_EQ(split.train.measurements.size(), 80u);
  EXPECT_EQ(ids(split_batch(batch, 0.2, 7).validation), ids(split.validation));
  EXPECT_NE(ids(split_batch(batch, 0.2, 8).validation), ids(split.validation));
  std::set<std::string> all;
  for (const auto& id : ids(split.train)) all.insert(id);
  for (const auto& id : ids(split.validation)) all.insert(id);
  EXPECT_EQ(all.size(), 100u);
}

TEST(SplitBatch, KeepsTheOrderInTimeAndIndices) {
  MeasurementBatch batch = make_batch(make_cell(), 50, 1, kTool);
  for (int i = 0; i < 50; ++i) batch.measurements[static_cast<std::size_t>(i)].context.index = i;
  const BatchSplit split = split_batch(batch, 0.5, 1);
  for (const MeasurementBatch* part : {&split.train, &split.validation}) {
    for (std::size_t i = 1; i < part->measurements.size(); ++i) {
      EXPECT_LT(part->measurements[i - 1].context.index, part->measurements[i].context.index);
    }
  }
}

TEST(SplitBatch, FollowsTheSetColumnWhereThereIsOne) {
  MeasurementBatch batch = make_batch(make_cell(), 4, 1, kTool);
  batch.measurements[0].set = MeasurementSet::kTrain;
  batch.measurements[2].set = MeasurementSet::kValidation;
  const BatchSplit split = split_batch(batch, 0.9, 1);
  EXPECT_EQ(ids(split.validation), std::vector<std::string>{"3"});
  EXPECT_EQ(ids(split.train), (std::vector<std::string>{"1", "2", "4"}));
}

TEST(SplitBatch, LeavesARowForTraining) {
  const MeasurementBatch batch = make_batch(make_cell(), 3, 1, kTool);
  EXPECT_EQ(split_batch(batch, 1, 1).train.measurements.size(), 1u);
  EXPECT_EQ(split_batch(batch, 0, 1).validation.measurements.size(), 0u);
  EXPECT_EQ(split_batch(MeasurementBatch{}, 0.5, 1).train.measurements.size(), 0u);
}

TEST(SplitBatch, HoldsOutAllRowsOfAPoseTogether) {
  MeasurementBatch batch = make_batch(make_cell(), 90, 1, kTool);
  for (std::size_t i = 1; i < 90; ++i)
    batch.measurements[i].context.q = batch.measurements[i - i % 3].context.q;
  const std::vector<bool> held_out = rows_held_out(batch, 0.2, 7);
  for (std::size_t i = 0; i < 90; ++i) EXPECT_EQ(held_out[i], held_out[i - i % 3]) << i;
  EXPECT_EQ(std::count(held_out.begin(), held_out.end(), true), 18)
      << "a fifth of 30 poses, three rows each";
}

/// When the newest of measurements of these times was taken, in a batch taken in at 1.7e9.
std::int64_t newest_of(const std::vector<std::optional<double>>& times) {
  MeasurementBatch batch;
  for (const std::optional<double>& time : times)
    batch.measurements.emplace_back().context.time = time;
  return dated(std::move(batch), 1'700'000'000).measured_at.value();
}

TEST(Dated, TheNewestUnixTimeCountsElseWhenTheBatchWasTakenIn) {
  EXPECT_EQ(newest_of({1.6e9, 1'600'000'100.7, std::nullopt, 1.5e9}), 1'600'000'100);
  EXPECT_EQ(newest_of({}), 1'700'000'000);
  EXPECT_EQ(newest_of({std::nullopt, std::nullopt}), 1'700'000'000);
  EXPECT_EQ(newest_of({0.0, 3600.0, 1e6}), 1'700'000'000) << "counted from some start of its own";
  EXPECT_EQ(newest_of({1.6e12}), 1'700'000'000) << "milliseconds";
  EXPECT_EQ(newest_of({1.7e9 + 3600}), 1'700'003'600) << "a clock that is a little ahead";
}

}  // namespace
}  // namespace trammel
