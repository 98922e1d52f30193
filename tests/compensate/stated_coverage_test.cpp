#include <gtest/gtest.h>

#include "server/compensate/compensated_model.h"
#include "tests/support/demand.h"
#include "tests/support/virtual_robot.h"

namespace trammel {
namespace {

/// The share of a robot that is as it is drawn, its positions off by `times` the stated sigma.
double share(double times) {
  const auto cell = test::cell_7();
  CompensatedModel::Parts parts;
  parts.physics = test::demand(make_physical_model(cell, {}));
  parts.q_min = JointVector::Constant(6, -1);
  parts.q_max = JointVector::Constant(6, 1);
  parts.covariance = Eigen::MatrixXd::Zero(0, 0);
  parts.discrepancy = 1;  // m: intervals that hold whatever is left
  const VirtualRobot robot{parts.physics, cell->tracker.sigma, cell->tracker.sigma_rotation, {}};
  MeasurementBatch batch = test::measured(robot, 400, 3, false);
  for (Measurement& m : batch.measurements) m.p_W += Vector3::Constant(times * cell->tracker.sigma);
  const CompensatedModel model = test::demand(CompensatedModel::make(std::move(parts)));
  const Evaluation evaluation = model.evaluate(batch);
  EXPECT_EQ(evaluation.coverage_95, 1);
  return evaluation.coverage_95_stated.value();
}

TEST(StatedCoverage, IsThatOfTheInstrumentAloneHoweverWideTheIntervalsAre) {
  EXPECT_NEAR(share(0), 0.95, 0.02);
  EXPECT_LT(share(10), 0.01);
}

}  // namespace
}  // namespace trammel
