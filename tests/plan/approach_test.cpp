#include "server/plan/approach.h"

#include <gtest/gtest.h>

#include <set>

#include "server/base/units.h"
#include "server/plan/plan.h"
#include "tests/support/virtual_robot.h"

namespace trammel {
namespace {

TEST(Approach, TheBumpIsFiveDegreesOnTheSideTheJointsComeFrom) {
  const Chain robot = test::cell_7()->robot;
  const JointVector q = JointVector::Constant(6, 0.1);
  EXPECT_TRUE(
      bump_pose(robot, q, Sides(6, -1))->isApprox(JointVector::Constant(6, 0.1 + from_deg(5))));
  EXPECT_TRUE(
      bump_pose(robot, q, Sides(6, 1))->isApprox(JointVector::Constant(6, 0.1 - from_deg(5))));
  const JointVector mixed = *bump_pose(robot, q, {1, -1, 1, 1, 1, 1});
  EXPECT_NEAR(mixed(0), 0.1 - from_deg(5), 1e-12);
  EXPECT_NEAR(mixed(1), 0.1 + from_deg(5), 1e-12);
}

TEST(Approach, TheBumpStaysWithinTheLimitsAndLeavesEnoughWay) {
  const Chain robot = test::cell_7()->robot;
  JointVector q = JointVector::Zero(6);
  q(1) = from_deg(83);  // 2 deg below its limit
  EXPECT_NEAR((*bump_pose(robot, q, Sides(6, -1)))(1), from_deg(85), 1e-12);
  EXPECT_NEAR((*bump_pose(robot, q, Sides(6, 1)))(1), from_deg(78), 1e-12);
  q(1) = from_deg(84.5);
  EXPECT_FALSE(bump_pose(robot, q, Sides(6, -1)));
  EXPECT_TRUE(bump_pose(robot, q, Sides(6, 1)));
  EXPECT_EQ(possible_sides(robot, q, Sides(6, -1)), (Sides{-1, 1, -1, -1, -1, -1}))
      << "joint 2 can only rise into it";
}

TEST(Approach, EachJointComesFromBothSidesEquallyOftenAndNoTwoTogether) {
  const Chain robot = test::cell_7()->robot;
  std::vector<int> sum(6, 0);
  Eigen::MatrixXi together = Eigen::MatrixXi::Zero(6, 6);
  for (int number = 0; number < 48; ++number) {
    const Sides sides = planned_sides(robot, number);
    for (std::size_t a = 0; a < 6; ++a) {
      sum[a] += sides[a];
      for (std::size_t b = 0; b < 6; ++b)
        together(static_cast<int>(a), static_cast<int>(b)) += sides[a] * sides[b];
    }
    if (number % 2 == 1) {
      EXPECT_EQ(sum, std::vector<int>(6, 0)) << number;
    }
  }
  EXPECT_EQ(together, 48 * Eigen::MatrixXi::Identity(6, 6));
}

TEST(Approach, TheGearsComeFromOneSideWhateverTheControllerCounts) {
  const Chain robot = test::cell_7()->robot;
  std::vector<Joint> joints;
  for (int j = 0; j < robot.size(); ++j) joints.push_back(robot.joint(j));
  for (const double ratio : {-1.0, 1.0}) {
    const Result<Chain> coupled = Chain::make("coupled", joints, {{2, 1, ratio}});
    ASSERT_TRUE(coupled);
    const JointVector q = JointVector::Constant(6, 0.1);
    for (const int direction : {1, -1}) {
      const JointVector move = q - *bump_pose(*coupled, q, Sides(6, direction));
      EXPECT_NEAR(move(1), direction * from_deg(5), 1e-12);
      EXPECT_NEAR(move(2) + ratio * move(1), direction * from_deg(5), 1e-12)
          << "what the gear of joint 3 turns";
    }
  }
}

TEST(Approach, TheProgramGridNeverLeavesTheLimits) {
  Joint joint;
  joint.lower = from_deg(-10.00004);
  joint.upper = from_deg(10.00006);
  const Chain robot = Chain::make("one", {joint}).value();
  const auto on_grid = [&](double deg) {
    return to_deg(on_program_grid(robot, JointVector::Constant(1, from_deg(deg)))(0));
  };
  EXPECT_NEAR(on_grid(3.141592), 3.1416, 1e-10);
  EXPECT_NEAR(on_grid(10.00006), 10.0, 1e-10);
  EXPECT_NEAR(on_grid(-10.00004), -10.0, 1e-10);
}

/// The side each joint really comes from, seen from the two poses of a plan.
void expect_directions_are_those_of_the_bump(const Cell& cell, const Plan& plan) {
  for (const PlannedPose& pose : plan.poses) {
    EXPECT_FALSE(cell.robot.joint_outside_limits(pose.bump));
    ASSERT_EQ(pose.context.direction.size(), 6u);
    for (int j = 0; j < 6; ++j) {
      const double way_deg = to_deg(pose.context.q(j) - pose.bump(j));
      EXPECT_EQ(pose.context.direction[static_cast<std::size_t>(j)], way_deg > 0 ? 1 : -1);
      EXPECT_GE(std::abs(way_deg), 0.999);
      EXPECT_LE(std::abs(way_deg), 5.001);
    }
  }
}

/// The excess of approaches of joint `j` from below over those from above in a plan.
int more_from_below(const Plan& plan, std::size_t j) {
  int sum = 0;
  for (const PlannedPose& pose : plan.poses) sum += pose.context.direction[j];
  return sum;
}

TEST(Approach, APlanGoesBothWaysWhateverItsPosesAreChosenFor) {
  const auto cell = test::cell_7();
  for (const PlanCriterion criterion :
       {PlanCriterion::kLatinHypercube, PlanCriterion::kObservability, PlanCriterion::kCheck}) {
    const Plan plan = make_plan(cell, {20, 7, criterion}).value();
    ASSERT_EQ(plan.poses.size(), 20u);
    expect_directions_are_those_of_the_bump(*cell, plan);
    for (std::size_t j = 0; j < 6; ++j)
      EXPECT_LE(std::abs(more_from_below(plan, j)), 2) << "joint " << j + 1;
  }
}

TEST(Approach, AJointThatCanComeFromOneSideOnlyKeepsNoPoseOut) {
  Cell cell = *test::cell_7();
  const double upper = cell.robot.joint(4).upper;
  cell.joint_ranges = planning_ranges(cell).value();
  cell.joint_ranges[4] = {upper - from_deg(0.5), upper - from_deg(0.1)};
  const auto shared = std::make_shared<const Cell>(cell);
  const Plan plan = make_plan(shared, {20, 7}).value();
  EXPECT_EQ(plan.draw.no_way, 0);
  expect_directions_are_those_of_the_bump(cell, plan);
  EXPECT_EQ(more_from_below(plan, 4), 20);
  EXPECT_EQ(more_from_below(plan, 3), 0);
}

TEST(Approach, ABidirectionalPlanHasEveryPoseTwice) {
  const auto cell = test::cell_7();
  PlanOptions options{40, 7};
  options.bidirectional = true;
  const Plan both = make_plan(cell, options).value();
  ASSERT_EQ(both.poses.size(), 80u);
  expect_directions_are_those_of_the_bump(*cell, both);
  std::set<std::string> ids;
  for (std::size_t i = 0; i < both.poses.size(); ++i) ids.insert(both.poses[i].id);
  EXPECT_EQ(ids.size(), 80u);
  for (std::size_t i = 0; i < both.poses.size(); i += 2) {
    EXPECT_EQ(both.poses[i].context.q, both.poses[i + 1].context.q);
    EXPECT_EQ(both.poses[i].context.direction[3], -both.poses[i + 1].context.direction[3]);
  }
}

TEST(Approach, OneWayComesFromBelowAlways) {
  const auto cell = test::cell_7();
  PlanOptions options{12, 7};
  options.one_way = true;
  for (const PlanCriterion criterion :
       {PlanCriterion::kLatinHypercube, PlanCriterion::kObservability}) {
    options.criterion = criterion;
    const Plan plan = make_plan(cell, options).value();
    ASSERT_EQ(plan.poses.size(), 12u);
    for (const PlannedPose& pose : plan.poses)
      EXPECT_EQ(pose.context.direction, Sides(6, 1)) << pose.id;
  }
  options.bidirectional = true;
  EXPECT_EQ(make_plan(cell, options).error().code, ErrorCode::kUsage);
}

TEST(Approach, TheArmStaysInTheWorkspaceOnTheWay) {
  Cell cell = *test::cell_7();
  cell.workspace = Workspace{{0, -1.4, 0.8}, {2, 1.4, 3.2}};
  const Plan plan = make_plan(std::make_shared<const Cell>(cell), {40, 1}).value();
  for (const PlannedPose& pose : plan.poses) {
    for (const JointVector& q : {pose.context.q, pose.bump}) {
      const Vector3 p = (cell.robot.flange_pose(q) * *cell.tools.at("spindle")).translation();
      EXPECT_TRUE((p.array() >= cell.workspace->lower.array() - 1e-5).all() &&
                  (p.array() <= cell.workspace->upper.array() + 1e-5).all());
    }
  }
  EXPECT_GT(plan.draw.outside, 0);
}

TEST(Approach, SeveralPayloadsComeInTurnAndTogether) {
  Cell cell = *test::cell_7();
  cell.payloads["empty"] = Payload{};
  PlanOptions options{20, 1};
  const auto shared = std::make_shared<const Cell>(cell);
  EXPECT_FALSE(make_plan(shared, options)) << "which payload?";
  options.payloads = {"spindle", "empty"};
  const Plan plan = make_plan(shared, options).value();
  for (std::size_t i = 0; i < 20; ++i)
    EXPECT_EQ(plan.poses[i].context.payload, i < 10 ? "empty" : "spindle");
  options.payloads = {"anvil"};
  EXPECT_FALSE(make_plan(shared, options));
}

}  // namespace
}  // namespace trammel
