#include "server/measurement/checked_batch.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <type_traits>

#include "tests/support/demand.h"
#include "tests/support/virtual_robot.h"

namespace trammel {
namespace {

static_assert(!std::is_default_constructible_v<CheckedBatch>);
static_assert(!std::is_constructible_v<CheckedBatch, MeasurementBatch>,
              "what is not checked cannot become one");

MeasurementBatch measured(int poses, const std::string& id = "lt-07", std::uint64_t seed = 3) {
  MeasurementBatch batch = test::measured(test::chapter_5_robot(test::cell_7()), poses, seed);
  batch.id = id;
  return batch;
}

CheckedBatch checked(MeasurementBatch batch, const HoldOut& hold_out = drawn(0, 0)) {
  return test::demand(check_against_cell(std::move(batch), *test::cell_7(), hold_out));
}

std::vector<int> rows_of(const MeasurementBatch& batch) {
  std::vector<int> rows;
  for (const Measurement& m : batch.measurements) rows.push_back(m.row);
  return rows;
}

TEST(CheckedBatch, HasEachRowAmongThoseToLearnFromOrThoseHeldOut) {
  const CheckedBatch batch = checked(measured(50), drawn(0.2, 7));
  EXPECT_EQ(batch.held_out().measurements.size(), 10U);
  EXPECT_EQ(batch.training().measurements.size(), 40U);
  for (const Measurement& m : batch.training().measurements)
    EXPECT_EQ(m.set, MeasurementSet::kTrain);
  for (const Measurement& m : batch.held_out().measurements)
    EXPECT_EQ(m.set, MeasurementSet::kValidation);
  std::vector<int> both = rows_of(batch.training());
  const std::vector<int> held_out = rows_of(batch.held_out());
  both.insert(both.end(), held_out.begin(), held_out.end());
  std::sort(both.begin(), both.end());
  EXPECT_EQ(both, rows_of(batch.rows()));
}

TEST(CheckedBatch, IsSplitByItsSetColumnWhereItHasOneAndKeepsWhatThatSaid) {
  MeasurementBatch with_column = measured(20);
  with_column.measurements[3].set = MeasurementSet::kValidation;
  const CheckedBatch batch = checked(with_column, drawn(0.5, 7));
  EXPECT_EQ(rows_of(batch.held_out()), std::vector<int>{with_column.measurements[3].row});
  EXPECT_EQ(batch.rows().measurements[0].set, MeasurementSet::kUnassigned);
}

TEST(CheckedBatch, ATemperatureInKelvinIsRefusedWithItsUnit) {
  MeasurementBatch batch = measured(20);
  batch.measurements[7].context.temperature = 80;
  EXPECT_TRUE(check_against_cell(batch, *test::cell_7()));
  batch.measurements[7].context.temperature = 295.1;
  const auto refused = check_against_cell(batch, *test::cell_7());
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().field, "temperature_c");
  EXPECT_EQ(refused.error().row, batch.measurements[7].row);
  EXPECT_NE(refused.error().next.find("kelvin"), std::string::npos);
}

TEST(CheckedBatch, APlaceholderInAFewRowsIsNoOtherUnitOfAllPositions) {
  MeasurementBatch batch = measured(60);
  for (const std::size_t row : {3U, 17U, 40U}) batch.measurements[row].p_W.setConstant(-99.99);
  EXPECT_TRUE(check_against_cell(batch, *test::cell_7()));
  for (Measurement& m : batch.measurements) m.p_W *= 1000;
  EXPECT_FALSE(check_against_cell(batch, *test::cell_7())) << "all in another unit";
}

TEST(CheckedBatch, IsKnownByTheHashOfWhatCame) {
  MeasurementBatch batch = measured(20);
  for (std::size_t i = 0; i < batch.measurements.size(); ++i) {
    batch.measurements[i].context.time = 1000.0 + 10.0 * static_cast<double>(i);
  }
  const CheckedBatch made = checked(batch);
  EXPECT_EQ(made.hash(), batch_hash(batch));
  EXPECT_EQ(*made.rows().measurements[0].context.time, 0) << "times count from the first pose";
  EXPECT_EQ(made.holding_out(std::vector<bool>(20, true)).hash(), made.hash());
}

TEST(CheckedBatch, HoldsOutMoreRowsAndNeverFewer) {
  const CheckedBatch batch = checked(measured(10), drawn(0.2, 7));
  std::vector<bool> more(10, false);
  more[0] = true;
  const CheckedBatch fewer_to_learn = batch.holding_out(more);
  const std::vector<int> held_out = rows_of(fewer_to_learn.held_out());
  for (const int row : rows_of(batch.held_out()))
    EXPECT_EQ(std::count(held_out.begin(), held_out.end(), row), 1);
  EXPECT_EQ(std::count(held_out.begin(), held_out.end(), batch.rows().measurements[0].row), 1);
}

TEST(CheckedBatch, PutsPosesIntoTheOrderOfTheirTimesEachWithItsRowAndItsPart) {
  MeasurementBatch backwards = measured(12);
  for (std::size_t i = 0; i < 12; ++i)
    backwards.measurements[i].context.time = 100.0 * static_cast<double>(12 - i);
  backwards.measurements[0].set = MeasurementSet::kValidation;
  const CheckedBatch batch = checked(backwards);
  EXPECT_FALSE(batch.is_in_order_of_time());
  const CheckedBatch ordered = batch.in_order_of_time(test::cell_7()->robot);
  EXPECT_TRUE(ordered.is_in_order_of_time());
  std::vector<int> expected = rows_of(backwards);
  std::reverse(expected.begin(), expected.end());
  EXPECT_EQ(rows_of(ordered.rows()), expected);
  EXPECT_EQ(ordered.rows().measurements[0].context.index, 0);
  EXPECT_EQ(rows_of(ordered.held_out()), std::vector<int>{backwards.measurements[0].row});
}

TEST(CheckedBatch, KnowsTheVelocitiesOfAContinuousPath) {
  MeasurementBatch path = measured(30);
  const JointVector from = path.measurements[0].context.q;
  for (std::size_t i = 0; i < path.measurements.size(); ++i) {
    Measurement& m = path.measurements[i];
    m.context.q = from + JointVector::Constant(from.size(), 1e-3 * static_cast<double>(i));
    m.context.time = 0.1 * static_cast<double>(i);
    m.p_W = Vector3(1, 0, 0) + 1e-3 * static_cast<double>(i) * Vector3(1, 1, 0);
  }
  const CheckedBatch batch = checked(path);
  ASSERT_TRUE(batch.rows().measurements[5].context.velocity);
  EXPECT_NEAR((*batch.rows().measurements[5].context.velocity)(2), 1e-2, 1e-9);
  EXPECT_TRUE(batch.training().measurements[5].context.velocity);
}

TEST(CheckedBatch, BatchesThatAreLearnedFromTogetherKeepWhatIsHeldOutOfEach) {
  const CheckedBatch one = checked(measured(20, "a"), drawn(0.2, 7)),
                     other = checked(measured(30, "b", 4), drawn(0.1, 7));
  const CheckedBatch both = joined({one, other});
  EXPECT_EQ(both.id(), "a+b");
  EXPECT_EQ(both.size(), 50U);
  EXPECT_EQ(both.held_out().measurements.size(), 4U + 3U);
  EXPECT_EQ(both.rows().measurements[20].pose_id, "b/" + other.rows().measurements[0].pose_id);
  EXPECT_EQ(both.rows().measurements[49].context.index, 49);
  EXPECT_EQ(joined({one}).id(), "a");
}

TEST(CheckedBatch, TheSameMeasurementsUnderTwoNamesCountOnce) {
  const CheckedBatch first = checked(measured(20, "a"), drawn(0.2, 7));
  MeasurementBatch renamed = measured(20, "b");
  for (Measurement& m : renamed.measurements) m.pose_id = "again-" + m.pose_id;
  renamed.measurements[7].p_W.x() += 1e-9;
  const CheckedBatch both = joined({first, checked(renamed), checked(measured(30, "c", 4))});
  EXPECT_EQ(both.size(), 20U + 1U + 30U) << "one row was measured again";
  EXPECT_EQ(both.rows().copies, 19);
  EXPECT_EQ(both.rows().measurements[20].pose_id,
            "b/again-" + measured(20).measurements[7].pose_id);
  EXPECT_EQ(both.held_out().measurements.size(), 4U)
      << "none of them is learned from under its other name";
  EXPECT_EQ(both.rows().sessions.size(), 3U);

  const CheckedBatch copied = joined({first, checked(measured(20, "b"))});
  EXPECT_EQ(copied.size(), 20U);
  EXPECT_EQ(copied.id(), "a") << "the other file is no session";
  EXPECT_EQ(copied.rows().copies, 20);
}

}  // namespace
}  // namespace trammel
