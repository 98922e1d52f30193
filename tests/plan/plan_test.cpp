#include "server/plan/plan.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "server/base/units.h"
#include "server/measurement/checked_batch.h"
#include "server/measurement/files/joint_list.h"
#include "tests/support/demand.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/virtual_robot.h"

namespace trammel {
namespace {

TEST(Plan, LatinHypercubeUsesEverySliceOfEveryJointOnce) {
  const JointRanges ranges = {{-1, 1}, {0, 5}, {2, 2.5}};
  const Eigen::MatrixXd q = latin_hypercube(ranges, 50, 3);
  for (std::size_t j = 0; j < ranges.size(); ++j) {
    std::vector<int> slices;
    for (int i = 0; i < 50; ++i) {
      const double share = (q(i, static_cast<Eigen::Index>(j)) - ranges[j].first) /
                           (ranges[j].second - ranges[j].first);
      slices.push_back(static_cast<int>(share * 50));
    }
    std::sort(slices.begin(), slices.end());
    for (int i = 0; i < 50; ++i) EXPECT_EQ(slices[static_cast<std::size_t>(i)], i);
  }
}

TEST(Plan, SameSeedSamePoses) {
  const auto cell = test::cell_7();
  EXPECT_EQ(*plan_poses(*cell, {30, 4}), *plan_poses(*cell, {30, 4}));
  EXPECT_NE(*plan_poses(*cell, {30, 4}), *plan_poses(*cell, {30, 5}));
}

TEST(Plan, KeepsToTheWorkspace) {
  Cell cell = *test::cell_7();
  cell.workspace = Workspace{{0, -1.4, 0.8}, {2, 1.4, 3.2}};
  const Eigen::MatrixXd q = *plan_poses(cell, {40, 1});
  ASSERT_EQ(q.rows(), 40);
  for (Eigen::Index i = 0; i < q.rows(); ++i) {
    const Vector3 p =
        (cell.robot.flange_pose(q.row(i).transpose()) * *cell.tools.at("spindle")).translation();
    EXPECT_TRUE((p.array() >= cell.workspace->lower.array()).all() &&
                (p.array() <= cell.workspace->upper.array()).all());
  }
  cell.workspace = Workspace{{50, 50, 50}, {51, 51, 51}};
  EXPECT_FALSE(plan_poses(cell, {40, 1}));
  EXPECT_FALSE(plan_poses(cell, {0, 1}));
}

TEST(Plan, OfContactsBringsTheTipToOnePointInVariedPostures) {
  const auto cell = test::cell_7();
  PlanOptions options{12, 1};
  options.criterion = PlanCriterion::kObservability;
  options.orientation = false;
  options.contact_B = Vector3(1.5, 0.2, 1.1);
  const Plan plan = test::demand(make_plan(cell, options));
  ASSERT_EQ(plan.poses.size(), 12U);
  double least = 10, most = -10;
  for (const PlannedPose& pose : plan.poses) {
    const Vector3 p =
        (cell->robot.flange_pose(pose.context.q) * *cell->tools.at("spindle")).translation();
    EXPECT_LT((p - *options.contact_B).norm(), 0.1e-3) << pose.id;
    least = std::min(least, pose.context.q(4));
    most = std::max(most, pose.context.q(4));
  }
  EXPECT_GT(most - least, 0.5) << "rad of joint 5";
}

/// A palletiser: bars keep the wrist level.
Cell palletiser() {
  const test::TemporaryFolder folder;
  folder.write("pal.yaml",
               "version: 1\nname: palletiser\njoints:\n"
               "  - {d_mm: 740, a_mm: 260, alpha_deg: -90, limits_deg: [-170, 170]}\n"
               "  - {theta_deg: -90, a_mm: 950, hayati: true, limits_deg: [-40, 80]}\n"
               "  - {theta_deg: 90, a_mm: 1000, hayati: true, limits_deg: [-20, 100]}\n"
               "  - {a_mm: 200, alpha_deg: 90, passive: true}\n"
               "  - {d_mm: -250, limits_deg: [-300, 300]}\n"
               "coupling:\n  - {joint: 3, follows: 2, ratio: -1, kind: parallelogram}\n"
               "  - {joint: 4, follows: 3, ratio: -1, kind: parallelogram}\n");
  return test::demand(
      read_cell(folder.write("cell.yaml",
                             "version: 1\ncell: pal\nrobot: pal.yaml\nbase: null\n"
                             "tools: {t1: null}\ntracker: {sigma_mm: 0.03}\n"
                             "model: {error_sources: [base, tool, geometry], bias: none}\n")));
}

TEST(Plan, APassiveJointIsNeverPlannedAndItsColumnMayBeLeftOut) {
  const auto cell = std::make_shared<const Cell>(palletiser());
  PlanOptions options;
  options.count = 20;
  for (const bool both : {false, true}) {
    options.bidirectional = both;
    const Plan plan = test::demand(make_plan(cell, options));
    for (const PlannedPose& pose : plan.poses) {
      EXPECT_EQ(pose.context.q(3), 0);
      EXPECT_EQ(pose.bump(3), 0);
      EXPECT_EQ(pose.context.direction[3], 0);
    }
  }
  const JointList driven = test::demand(check_against_cell(
      test::demand(parse_joint_csv("q1_deg,q2_deg,q3_deg,q4_deg,dir1,dir2,dir3,dir4\n"
                                   "10,20,30,200,1,-1,1,-1\n",
                                   "j.csv")),
      *cell));
  EXPECT_NEAR(driven.poses[0].context.q(4), from_deg(200), 1e-12);
  EXPECT_EQ(driven.poses[0].context.q(3), 0);
  EXPECT_EQ(driven.poses[0].context.direction, (std::vector<int>{1, -1, 1, 0, -1}));
  const CheckedBatch batch = test::demand(
      check_against_cell(test::demand(parse_batch_csv("q1_deg,q2_deg,q3_deg,q4_deg,x_mm,y_mm,z_mm\n"
                                                      "10,20,30,200,1500,10,900\n",
                                                      "b.csv")),
                         *cell));
  EXPECT_NEAR(batch.rows().measurements[0].context.q(4), from_deg(200), 1e-12);
}

}  // namespace
}  // namespace trammel
