#include "server/measurement/resolution.h"

#include <gtest/gtest.h>

#include <cmath>

#include "server/base/units.h"
#include "tests/support/virtual_robot.h"

namespace trammel {
namespace {

MeasurementBatch rounded(double step_mm) {
  MeasurementBatch batch = test::measured(test::chapter_5_robot(test::cell_7()), 40, 3);
  for (Measurement& m : batch.measurements)
    for (double& value : m.p_W) value = from_mm(step_mm * std::round(to_mm(value) / step_mm));
  return batch;
}

TEST(Resolution, PositionsOfADisplayAreSaidToBeCoarserThanTheStatedSigma) {
  const Cell& cell = *test::cell_7();  // 0.013 mm
  for (const double step : {0.05, 0.1, 1.0}) {
    const auto found = coarse_rounding(rounded(step), cell);
    ASSERT_TRUE(found) << step;
    EXPECT_NEAR(to_mm(found->step), step, 1e-9);
    EXPECT_NEAR(found->stddev(), found->step * 0.288675, 1e-9);
  }
  EXPECT_FALSE(coarse_rounding(rounded(0.01), cell)) << "a hundredth is finer than its sigma";
  EXPECT_FALSE(coarse_rounding(rounded(1e-7), cell));
}

TEST(Resolution, OneCoarseColumnAmongFineOnesIsNoticed) {
  MeasurementBatch batch = rounded(1e-7);
  for (Measurement& m : batch.measurements) m.p_W.x() = from_mm(std::round(to_mm(m.p_W.x())));
  EXPECT_TRUE(coarse_rounding(batch, *test::cell_7()));
}

TEST(Resolution, WhoStatesASigmaThatHoldsTheRoundingIsNotTold) {
  MeasurementBatch batch = rounded(0.1);
  for (Measurement& m : batch.measurements) m.sigma = 0.1e-3;
  EXPECT_FALSE(coarse_rounding(batch, *test::cell_7()));
  EXPECT_NEAR(sigma_of_rows(batch).value_or(0), 0.1e-3, 1e-12);
}

TEST(Resolution, OfJointsAndDistancesIsTheStepOfTheirColumns) {
  MeasurementBatch batch = rounded(1e-7);
  batch.joint_types.assign(6, JointType::kRevolute);
  for (Measurement& m : batch.measurements)
    for (double& q : m.context.q) q = from_deg(0.1 * std::round(to_deg(q) / 0.1));
  EXPECT_NEAR(to_deg(joint_step(batch).value_or(0)), 0.1, 1e-9);
  for (Measurement& m : batch.measurements) {
    m.gauge = Gauge{};
    m.gauge->value = from_mm(std::round(1000 + to_mm(m.p_W.x())));
    m.sigma = 0.2e-3;
  }
  const auto found = coarse_rounding(batch, *test::cell_7());
  ASSERT_TRUE(found);
  EXPECT_TRUE(found->is_of_gauges);
  EXPECT_NEAR(to_mm(found->step), 1, 1e-9);
}

TEST(Resolution, FewOrEqualNumbersTellNoStep) {
  EXPECT_FALSE(step_of({1, 2, 3}));
  EXPECT_FALSE(step_of(std::vector<double>(40, 7)));
}

}  // namespace
}  // namespace trammel
