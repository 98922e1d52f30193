#include "server/measurement/history.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/demand.h"

namespace trammel {
namespace {

/// One pose a minute, one joint, the temperature rising by a degree a minute from 20 on.
MeasurementBatch warming(int poses) {
  MeasurementBatch batch;
  for (int i = 0; i < poses; ++i) {
    Measurement m;
    m.context.q = JointVector::Constant(1, i % 2 == 0 ? 0.1 * i : -0.1 * i);
    m.context.time = 60.0 * i;
    m.context.temperature = 20.0 + i;
    batch.measurements.push_back(m);
  }
  return batch;
}

Chain one_joint() { return test::demand(Chain::make("one", {Joint{}})); }

TEST(History, TheRowBeforeIsWhereTheRobotCameFrom) {
  MeasurementBatch batch = warming(4);
  fill_history(batch, one_joint());
  EXPECT_FALSE(batch.measurements[0].context.before);
  for (std::size_t i = 1; i < 4; ++i)
    EXPECT_EQ(batch.measurements[i].context.before, batch.measurements[i - 1].context.q);
}

TEST(History, ABodyFollowsARampByItsLag) {
  MeasurementBatch batch = warming(60);
  fill_history(batch, one_joint());
  for (const Measurement& m : batch.measurements) {
    ASSERT_EQ(m.context.lagged.size(), kHeatLags.size());
    for (std::size_t k = 0; k < kHeatLags.size(); ++k) {
      const double t = *m.context.time;
      const double expected = 20 + (t - kHeatLags[k] * (1 - std::exp(-t / kHeatLags[k]))) / 60;
      EXPECT_NEAR(m.context.lagged[k], expected, 1e-9) << t << " s, " << kHeatLags[k];
    }
  }
}

TEST(History, IsUnknownWhereTheBatchDoesNotSayIt) {
  const auto filled = [](const auto& change) {
    MeasurementBatch batch = warming(4);
    change(batch);
    fill_history(batch, one_joint());
    return batch;
  };
  const auto before = [](const MeasurementBatch& batch) {
    return batch.measurements[2].context.before.has_value();
  };
  const auto lagged = [](const MeasurementBatch& batch) {
    return !batch.measurements[2].context.lagged.empty();
  };
  const MeasurementBatch untimed =
      filled([](MeasurementBatch& b) { b.measurements[3].context.time.reset(); });
  EXPECT_FALSE(before(untimed) || lagged(untimed));
  const MeasurementBatch unordered =
      filled([](MeasurementBatch& b) { b.measurements[3].context.time = 1; });
  EXPECT_FALSE(before(unordered) || lagged(unordered));
  const MeasurementBatch cold =
      filled([](MeasurementBatch& b) { b.measurements[3].context.temperature.reset(); });
  EXPECT_TRUE(before(cold));
  EXPECT_FALSE(lagged(cold));
  // From above, says the column, while the row before was below: it went elsewhere in between.
  const MeasurementBatch around =
      filled([](MeasurementBatch& b) { b.measurements[2].context.direction = {-1}; });
  EXPECT_FALSE(before(around));
  EXPECT_TRUE(
      before(filled([](MeasurementBatch& b) { b.measurements[2].context.direction = {1}; })));
  EXPECT_FALSE(before(filled(
      [](MeasurementBatch& b) { b.measurements[2].context.velocity = JointVector::Ones(1); })));
}

TEST(History, SidesOfApproachAreHeldAgainstTheWayOfTheGears) {
  // Joint 2 is counted against the world: it rises by 0.1 while its gear falls by 0.1.
  const Chain robot = test::demand(Chain::make("two", {Joint{}, Joint{}}, {{1, 0, -1.0}}));
  const auto is_known = [&](const std::vector<int>& sides) {
    MeasurementBatch batch = warming(2);
    batch.measurements[0].context.q = Eigen::Vector2d::Zero();
    batch.measurements[1].context.q = Eigen::Vector2d(0.2, 0.1);
    batch.measurements[1].context.direction = sides;
    fill_history(batch, robot);
    return batch.measurements[1].context.before.has_value();
  };
  EXPECT_TRUE(is_known({1, -1}));
  EXPECT_FALSE(is_known({1, 1}));
}

TEST(History, BeginsAnewWithEverySession) {
  MeasurementBatch batch = warming(6);
  for (std::size_t i = 3; i < 6; ++i) {
    batch.measurements[i].session = 1;
    *batch.measurements[i].context.time -= 180;
  }
  fill_history(batch, one_joint());
  EXPECT_FALSE(batch.measurements[3].context.before);
  EXPECT_EQ(batch.measurements[3].context.lagged.back(), 23);
  EXPECT_TRUE(batch.measurements[4].context.before);
}

}  // namespace
}  // namespace trammel
