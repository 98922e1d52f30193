#include "server/plan/visibility.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "server/base/units.h"
#include "server/plan/plan.h"
#include "tests/support/refusal.h"
#include "tests/support/virtual_robot.h"

namespace trammel {
namespace {

using test::Refusal;
using test::refusal_of;

/// cell-7 with a tracker 4 m in front of the robot whose target, a T-Mac, is seen within 30 deg.
Cell watched_cell() {
  Cell cell = *test::cell_7();
  cell.X_WB = make_pose(rotation_exp({0, 0, 0.4}), {0.3, -0.2, 0.1});
  cell.tracker.p_W = Vector3(4, 1, 1.5);
  cell.tracker.aperture = from_deg(30);
  return cell;
}

/// From first principles: the cosine between the tool's axis and the way to the tracker.
double angle_deg(const Cell& cell, const JointVector& q, int axis) {
  const Pose X_WT = *cell.X_WB * cell.robot.flange_pose(q) * *cell.tools.at("spindle");
  const Vector3 way = *cell.tracker.p_W - X_WT.translation();
  return to_deg(std::acos(X_WT.linear().col(axis).dot(way) / way.norm()));
}

TEST(Visibility, AngleIsThatBetweenTheNormalAndTheLineOfSight) {
  const Pose X_WT = make_pose(Matrix3::Identity(), {1, 2, 3});
  EXPECT_NEAR(visibility_angle(X_WT, Vector3::UnitZ(), {1, 2, 9}), 0, 1e-12);
  EXPECT_NEAR(visibility_angle(X_WT, Vector3::UnitZ(), {1, 2, 0}), kPi, 1e-12);
  EXPECT_NEAR(visibility_angle(X_WT, Vector3::UnitZ(), {2, 2, 4}), kPi / 4, 1e-12);
  EXPECT_NEAR(visibility_angle(X_WT, Vector3::UnitX(), {1, 7, 3}), kPi / 2, 1e-12);
  EXPECT_EQ(visibility_angle(X_WT, Vector3::UnitX(), {1, 2, 3}), kPi);
}

TEST(Visibility, EveryPlannedPoseShowsTheTrackerItsTarget) {
  const Cell cell = watched_cell();
  const auto shared = std::make_shared<const Cell>(cell);
  PlanOptions options{30, 3};
  for (const PlanCriterion criterion :
       {PlanCriterion::kLatinHypercube, PlanCriterion::kObservability}) {
    options.criterion = criterion;
    const Result<Plan> plan = make_plan(shared, options);
    ASSERT_TRUE(plan) << plan.error().message;
    ASSERT_EQ(plan->poses.size(), 30u);
    for (const PlannedPose& pose : plan->poses)
      EXPECT_LE(angle_deg(cell, pose.context.q, 2), 30 + 1e-9);
    EXPECT_GT(plan->draw.unseen, plan->draw.kept);
    EXPECT_EQ(plan->draw.drawn,
              plan->draw.kept + plan->draw.unseen + plan->draw.outside + plan->draw.no_way);
  }
  const Eigen::MatrixXd q = plan_poses(cell, {30, 3}).value();
  for (Eigen::Index i = 0; i < q.rows(); ++i)
    EXPECT_LE(angle_deg(cell, q.row(i).transpose(), 2), 30 + 1e-9);
}

TEST(Visibility, ATargetThatLooksAlongAnotherAxisIsSeenFromThere) {
  Cell cell = watched_cell();
  cell.tracker.target_normal_T = Vector3::UnitX();
  const Eigen::MatrixXd q = plan_poses(cell, {20, 3}).value();
  bool another = false;
  for (Eigen::Index i = 0; i < q.rows(); ++i) {
    EXPECT_LE(angle_deg(cell, q.row(i).transpose(), 0), 30 + 1e-9);
    another = another || angle_deg(cell, q.row(i).transpose(), 2) > 30;
  }
  EXPECT_TRUE(another);
}

TEST(Visibility, WithoutTrackerPositionOrApertureEverythingIsSeen) {
  for (const bool has_position : {true, false}) {
    Cell cell = watched_cell();
    if (has_position) {
      cell.tracker.aperture.reset();
    } else {
      cell.tracker.p_W.reset();
    }
    cell.X_WB.reset();
    EXPECT_EQ(plan_poses(cell, {30, 3}).value(), plan_poses(*test::cell_7(), {30, 3}).value());
  }
}

TEST(Visibility, WhereBaseOrToolIsUnknownItCannotBeTold) {
  Cell cell = watched_cell();
  cell.X_WB.reset();
  EXPECT_EQ(refusal_of(plan_poses(cell, {30, 3})), Refusal("", {}, "base"));
  cell = watched_cell();
  cell.tools["spindle"].reset();
  EXPECT_EQ(refusal_of(plan_poses(cell, {30, 3})), Refusal("", {}, "tools"));
}

TEST(Visibility, APlanThatTheTrackerCannotSeeIsRefusedWithTheCounts) {
  Cell cell = watched_cell();
  cell.tracker.aperture = from_deg(0.01);
  const Result<Eigen::MatrixXd> plan = plan_poses(cell, {50, 1});
  ASSERT_FALSE(plan);
  EXPECT_EQ(plan.error().field, "count");
  EXPECT_LT(plan.error().value, plan.error().limit);
}

std::string cell_text(const std::string& tracker) {
  return "version: 1\ncell: c\nrobot: r\nbase: null\ntools: {t: null}\ntracker: " + tracker + "\n";
}

TEST(Visibility, CellFilesSayApertureAndNormal) {
  const std::string robot = test::cell_7()->robot_yaml;
  const auto cell =
      parse_cell(cell_text("{xyz_mm: [1000, 0, 0], aperture_deg: 30, target_normal: [0, 0, -2]}"),
                 robot, "c.yaml");
  ASSERT_TRUE(cell) << cell.error().message;
  EXPECT_NEAR(*cell->tracker.aperture, kPi / 6, 1e-12);
  EXPECT_TRUE(cell->tracker.target_normal_T.isApprox(-Vector3::UnitZ()));
  for (const char* wrong :
       {"{aperture_deg: 0}", "{aperture_deg: 181}", "{target_normal: [0, 0, 0]}"}) {
    EXPECT_FALSE(parse_cell(cell_text(wrong), robot, "c.yaml")) << wrong;
  }
}

}  // namespace
}  // namespace trammel
