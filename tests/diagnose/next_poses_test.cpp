#include "server/diagnose/tell/next_poses.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>

#include "server/base/units.h"
#include "server/diagnose/diagnose.h"
#include "server/diagnose/families/candidates.h"
#include "server/measurement/checked_batch.h"
#include "server/measurement/files/joint_list.h"
#include "server/measurement/pose_columns.h"
#include "server/plan/plan.h"
#include "server/simulate/simulate.h"
#include "tests/support/demand.h"
#include "tests/support/virtual_robot.h"

namespace trammel::cause_search {
namespace {

std::vector<std::string> shipped_robots() {
  std::vector<std::string> all;
  for (const auto& entry : std::filesystem::directory_iterator(TRAMMEL_SOURCE_DIR "/models"))
    if (entry.path().extension() == ".yaml") all.push_back(entry.path().string());
  std::sort(all.begin(), all.end());
  return all;
}

/// A cell with that robot; its joints are limited a little off every grid.
std::shared_ptr<Cell> cell_with(const std::string& robot, bool odd) {
  Cell cell = *test::cell_7();
  cell.robot = test::demand(read_robot(robot));
  cell.joint_ranges.clear();
  cell.payloads.clear();
  cell.tools.clear();
  cell.tools["probe"] = make_pose(Matrix3::Identity(), {0.1, 0.02, 0.15});
  for (int j = 0; odd && j < cell.robot.size(); ++j) {
    const Joint& joint = cell.robot.joint(j);
    cell.joint_ranges.emplace_back(joint.lower + 0.0123456789, joint.upper - 0.0098765432);
  }
  return std::make_shared<Cell>(std::move(cell));
}

/// Poses of a small part of the cell's ranges.
Eigen::MatrixXd narrow(const Cell& cell) {
  const JointRanges ranges = test::demand(planning_ranges(cell));
  Eigen::MatrixXd q = latin_hypercube(ranges, 60, 3);
  for (Eigen::Index j = 0; j < q.cols(); ++j) {
    const auto [lower, upper] = ranges[static_cast<std::size_t>(j)];
    q.col(j).array() =
        0.55 * lower + 0.45 * upper + 0.1 * (q.col(j).array() - 0.5 * (lower + upper));
  }
  return q;
}

/// A search that ended in doubt of joint 2's encoder.
SearchResult in_doubt(const std::shared_ptr<const Cell>& cell) {
  SearchResult found;
  found.before.model = test::demand(make_physical_model(cell, {"base", "geometry"}));
  found.before.priors = found.before.model.parameters();
  found.after = found.before;
  const VirtualRobot robot{
      found.before.model, cell->tracker.sigma, cell->tracker.sigma_rotation, {}};
  found.all =
      test::demand(check_against_cell(test::demand(simulate(robot, narrow(*cell), {})), *cell))
          .rows();
  found.batch = found.all;
  Accepted one;
  one.cause = {"encoder_eccentricity", 1};
  one.could_also_be = {{"tool"}};
  found.accepted = {one};
  return found;
}

std::vector<JointVector> suggested(const std::shared_ptr<const Cell>& cell) {
  const SearchResult found = in_doubt(cell);
  const LinearProblem before(found.before.model, found.batch, found.before.priors,
                             candidate_sources(*cell, found.batch, nullptr));
  DiagnoseOptions options;
  options.next_poses = 8;
  return next_poses_for(found, before, options).q;
}

/// What a plan says of them once they were written and read.
Result<Plan> planned(const std::vector<JointVector>& q, const Cell& cell) {
  JointList list{"next.csv", joint_types(cell.robot), {}};
  for (const JointVector& one : q) {
    list.poses.push_back({fmt::format("n{}", list.poses.size() + 1), {}, 0});
    list.poses.back().context.q = one;
  }
  Result<JointList> read =
      check_against_cell(test::demand(parse_joint_csv(to_csv(list), "next.csv")), cell);
  if (!read) return tl::make_unexpected(read.error());
  return plan_of(cell, *read);
}

TEST(NextPoses, APlanTakesWhatIsSuggestedForEveryShippedRobot) {
  for (const std::string& robot : shipped_robots()) {
    for (const bool odd : {false, true}) {
      const auto cell = cell_with(robot, odd);
      const std::vector<JointVector> q = suggested(cell);
      ASSERT_EQ(q.size(), 8u) << robot;
      const Result<Plan> plan = planned(q, *cell);
      ASSERT_TRUE(plan) << robot << (odd ? " (odd): " : ": ") << plan.error().message;
      for (std::size_t i = 0; i < q.size(); ++i)
        EXPECT_LT((plan->poses[i].context.q - q[i]).cwiseAbs().maxCoeff(), 1e-12)
            << "measured as suggested";
    }
  }
}

TEST(NextPoses, StayInTheWorkspaceAndInSightOnTheWayToo) {
  const auto cell = cell_with(TRAMMEL_SOURCE_DIR "/models/abb_irb6640-205-275.yaml", false);
  cell->workspace = Workspace{{0.5, -2, 0}, {3, 2, 2.5}};
  cell->tracker.p_W = Vector3(6, 0, 1);
  cell->tracker.aperture = from_deg(60);
  const std::vector<JointVector> q = suggested(cell);
  ASSERT_EQ(q.size(), 8u);
  const Result<Plan> plan = planned(q, *cell);
  ASSERT_TRUE(plan) << plan.error().message;
  for (const PlannedPose& pose : plan->poses) {
    const Vector3 p_BT =
        cell->robot.flange_pose(pose.context.q) * cell->tools["probe"]->translation();
    EXPECT_TRUE((p_BT.array() >= cell->workspace->lower.array()).all() &&
                (p_BT.array() <= cell->workspace->upper.array()).all());
  }
}

}  // namespace
}  // namespace trammel::cause_search
