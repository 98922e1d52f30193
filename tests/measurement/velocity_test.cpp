#include "server/measurement/velocity.h"

#include <gtest/gtest.h>

namespace trammel {
namespace {

JointVector position(double t) { return Eigen::Vector3d(0.3 * t, 1 - 0.2 * t + 0.5 * t * t, 0.1); }
JointVector velocity(double t) { return Eigen::Vector3d(0.3, -0.2 + t, 0); }

MeasurementBatch path(const std::vector<double>& times) {
  MeasurementBatch batch;
  for (const double t : times) {
    Measurement m;
    m.context.q = position(t);
    m.context.time = 1000 + t;
    batch.measurements.push_back(m);
  }
  return batch;
}

bool none_has_velocity(const MeasurementBatch& batch) {
  for (const Measurement& m : batch.measurements) {
    if (m.context.velocity) return false;
  }
  return true;
}

TEST(Velocity, IsExactForConstantAccelerationAlsoWithUnequalStepsAndAtTheEnds) {
  const std::vector<double> times = {0, 0.02, 0.03, 0.05, 0.06};
  MeasurementBatch batch = path(times);
  ASSERT_TRUE(fill_velocity(batch));
  for (std::size_t i = 0; i < times.size(); ++i) {
    ASSERT_TRUE(batch.measurements[i].context.velocity);
    EXPECT_LT((*batch.measurements[i].context.velocity - velocity(times[i])).norm(), 1e-9) << i;
  }
}

TEST(Velocity, NeedsATimeInEveryRowThatGrows) {
  MeasurementBatch missing = path({0, 0.02, 0.04, 0.06});
  missing.measurements[2].context.time.reset();
  EXPECT_FALSE(fill_velocity(missing));
  MeasurementBatch standing = path({0, 0.02, 0.02, 0.04});
  EXPECT_FALSE(fill_velocity(standing));
  MeasurementBatch few = path({0, 0.02});
  EXPECT_FALSE(fill_velocity(few));
  EXPECT_TRUE(none_has_velocity(missing) && none_has_velocity(standing) && none_has_velocity(few));
}

TEST(Velocity, IsLeftOutWhereTheBatchIsNoContinuousPath) {
  MeasurementBatch one_by_one = path({0, 1.1, 2.2, 3.3});
  for (Measurement& m : one_by_one.measurements) m.context.q = position(0);
  EXPECT_FALSE(fill_velocity(one_by_one));
  MeasurementBatch gap = path({0, 0.01, 0.02, 0.06, 0.07});
  EXPECT_FALSE(fill_velocity(gap));
  MeasurementBatch jump = path({0, 0.01, 0.02, 0.03});
  jump.measurements[2].context.q(2) += 0.3;
  EXPECT_FALSE(fill_velocity(jump));
  EXPECT_TRUE(none_has_velocity(gap) && none_has_velocity(jump));
}

TEST(Velocity, IsClearedWhereTheRuleIsNotMet) {
  MeasurementBatch batch = path({0, 0.01, 0.02});
  ASSERT_TRUE(fill_velocity(batch));
  batch.measurements[1].context.time.reset();
  EXPECT_FALSE(fill_velocity(batch));
  EXPECT_TRUE(none_has_velocity(batch));
}

}  // namespace
}  // namespace trammel
