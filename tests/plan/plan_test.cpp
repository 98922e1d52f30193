#include "server/plan/plan.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

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

}  // namespace
}  // namespace trammel
