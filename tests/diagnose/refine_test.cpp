#include "server/diagnose/evidence/refine.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "server/diagnose/diagnose.h"
#include "server/measurement/checked_batch.h"
#include "server/plan/plan.h"
#include "server/simulate/simulate.h"
#include "tests/support/demand.h"
#include "tests/support/virtual_robot.h"

namespace trammel::cause_search {
namespace {

/// The shipped rail with the tool and payload of cell-7; which way is down.
std::shared_ptr<const Cell> rail(const Vector3& gravity_W) {
  auto cell = std::make_shared<Cell>(*test::cell_7());
  cell->robot =
      test::demand(read_robot(TRAMMEL_SOURCE_DIR "/models/abb_irb6640-205-275-on-rail.yaml"));
  cell->joint_ranges.clear();
  cell->gravity_W = gravity_W.normalized();
  return cell;
}

MeasurementBatch measured_on(const std::shared_ptr<const Cell>& cell, bool uneven,
                             std::uint64_t seed) {
  std::vector<std::string> sources = {"base", "geometry", "compliance_first_order"};
  if (uneven) sources.emplace_back("joint_map:4@1");
  VirtualRobot robot{test::demand(make_physical_model(cell, sources)),
                     cell->tracker.sigma,
                     cell->tracker.sigma_rotation,
                     {}};
  const std::vector<Parameter> parameters = robot.truth.parameters();
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  for (std::size_t k = 0; k < parameters.size(); ++k) {
    double& value = robot.truth.values(static_cast<Eigen::Index>(k));
    const bool compliance = parameters[k].name.starts_with("C");
    value +=
        0.15 * parameters[k].prior_scale * (compliance ? std::abs(normal(random)) : normal(random));
    if (parameters[k].name == "C1") value = 0;  // a rail does not give way along its travel
  }
  SimulateOptions options;
  options.seed = seed;
  return test::demand(simulate(robot, test::demand(plan_poses(*cell, {90, seed})), options));
}

TEST(Refine, WhatIsLeftOfARobotOnARailIsNoShiftAlongIt) {
  DiagnoseOptions options;
  options.recovery = false;
  options.next_poses = 0;
  for (const Vector3& down :
       {Vector3(0, 0, -1), Vector3(0, -1, 0), Vector3(0, -1, -0.05), Vector3(0, -1, 0.3)}) {
    for (std::uint64_t seed = 1; seed <= 3; ++seed) {
      const auto cell = rail(down);
      const Diagnosis d = test::demand(diagnose(cell, measured_on(cell, seed == 3, seed), options));
      ASSERT_TRUE(d.held_out_after);
      EXPECT_LT(d.after.axis_mean.norm(), 2e-6) << down.transpose() << ": " << d.sentence;
      EXPECT_LT(d.after.rms, 1.02 * d.before.rms) << down.transpose() << ": " << d.sentence;
      EXPECT_LT(d.after.rms, d.held_out_after->rms) << down.transpose() << ": " << d.sentence;
    }
  }
}

TEST(Refine, StepsAlongABoundAreTheBestOnesThatStayInside) {
  // One compliance at its bound: refining from the best fit leaves the best fit where it is.
  const auto cell = rail({0, 0, -1});
  const MeasurementBatch batch =
      test::demand(check_against_cell(measured_on(cell, false, 4), *cell)).rows();
  const CalibrationResult best =
      test::demand(calibrate(cell, {"base", "geometry", "compliance_first_order"}, batch, {}));
  PriorModel refined{best.model, {}};
  for (const IdentifiedParameter& one : best.parameters) refined.priors.push_back(one.parameter);
  refine(refined, batch, {});
  double square = 0;
  for (const Measurement& m : batch.measurements)
    square += (m.p_W - refined.model.pose_W(m.context).translation()).squaredNorm();
  EXPECT_NEAR(std::sqrt(square / 90), best.rms, 0.02 * best.rms);
}

}  // namespace
}  // namespace trammel::cause_search
