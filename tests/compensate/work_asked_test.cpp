#include "server/compensate/work_asked.h"

#include <gtest/gtest.h>

#include "server/base/units.h"
#include "server/plan/plan.h"
#include "server/tasks/train/train.h"
#include "tests/support/demand.h"
#include "tests/support/virtual_robot.h"

namespace trammel {
namespace {

CompensatedModel trained(const VirtualRobot& robot, int poses, std::uint64_t seed) {
  TrainOptions options;
  options.bias = "none";
  const MeasurementBatch batch = test::measured(robot, poses, seed);
  return test::demand(
      train(robot.truth.cell, test::demand(check_against_cell(batch, *robot.truth.cell)), options));
}

/// Poses in the cell's ranges, and some with joint 1 far beyond those of the training.
std::vector<PoseContext> work(const Cell& cell, int inside, int outside) {
  std::vector<PoseContext> poses;
  const Eigen::MatrixXd q = test::demand(plan_poses(cell, {inside + outside, 4}));
  for (Eigen::Index i = 0; i < q.rows(); ++i) {
    PoseContext pose;
    pose.q = q.row(i);
    if (i >= inside) pose.q(0) = from_deg(600);
    pose.tool = pose.payload = "spindle";
    poses.push_back(pose);
  }
  return poses;
}

TEST(WorkAsked, AnotherModelIsComparedWhereTheCellWorks) {
  const auto cell = test::cell_7();
  const VirtualRobot robot = test::chapter_5_robot(cell);
  const CompensatedModel before = trained(robot, 100, 1);
  const CompensatedModel after = trained(test::with_zero_off(robot, 2, 1e-3), 100, 2);
  const std::vector<PoseContext> poses = work(*cell, 60, 0);
  const WorkAsked asked = work_asked(before, &after, poses);
  EXPECT_EQ(asked.poses, 60);
  ASSERT_TRUE(asked.other);
  double farthest = 0;
  for (const PoseContext& pose : poses) {
    const Vector3 step = after.predict(pose.q, "spindle", "spindle").X_BT_predicted.translation() -
                         before.predict(pose.q, "spindle", "spindle").X_BT_predicted.translation();
    farthest = std::max(farthest, step.norm());
  }
  EXPECT_GT(farthest, 1e-3);
  EXPECT_NEAR(asked.difference_max, farthest, 1e-9);
  EXPECT_LT(asked.difference_rms, asked.difference_max);
  EXPECT_EQ(asked.farthest.front().difference, asked.difference_max);
  EXPECT_FALSE(work_asked(before, nullptr, poses).other);
}

TEST(WorkAsked, PosesOutsideTheDomainAreCountedAndAreTheOnesToMeasure) {
  const auto cell = test::cell_7();
  TrainOptions options;
  options.bias = "se";
  const MeasurementBatch batch = test::measured(test::chapter_5_robot(cell), 100, 1);
  const CompensatedModel model =
      test::demand(train(cell, test::demand(check_against_cell(batch, *cell)), options));
  const WorkAsked inside = work_asked(model, nullptr, work(*cell, 40, 0));
  const WorkAsked asked = work_asked(model, nullptr, work(*cell, 40, 5));
  EXPECT_GE(asked.in_force.out_of_domain, inside.in_force.out_of_domain + 5);
  EXPECT_GT(asked.in_force.rms, inside.in_force.rms);
  ASSERT_FALSE(asked.measure_next.empty());
  EXPECT_EQ(asked.measure_next.front().q(0), from_deg(600));
}

TEST(WorkAsked, NearPosesAreMeasuredOnce) {
  const auto cell = test::cell_7();
  const CompensatedModel model = trained(test::chapter_5_robot(cell), 100, 1);
  std::vector<PoseContext> poses = work(*cell, 4, 0);
  for (int i = 0; i < 30; ++i) {
    PoseContext again = poses[static_cast<std::size_t>(i % 4)];
    again.q(2) += 1e-3 * i;
    poses.push_back(again);
  }
  EXPECT_EQ(work_asked(model, nullptr, poses).measure_next.size(), 4u);
}

TEST(WorkAsked, PosesOfAToolThatTheModelDoesNotKnowAreLeftOut) {
  const auto cell = test::cell_7();
  const CompensatedModel model = trained(test::chapter_5_robot(cell), 100, 1);
  std::vector<PoseContext> poses = work(*cell, 4, 0);
  poses[1].tool = "probe";
  EXPECT_EQ(work_asked(model, nullptr, poses).poses, 3);
  for (PoseContext& pose : poses) pose.tool = "probe";
  EXPECT_EQ(work_asked(model, nullptr, poses).poses, 0);
}

}  // namespace
}  // namespace trammel
