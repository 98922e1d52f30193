#include "server/plan/clearance.h"

#include <gtest/gtest.h>

#include <random>

#include "server/base/units.h"
#include "server/measurement/files/joint_list.h"
#include "server/plan/measuring_program.h"
#include "server/plan/plan.h"
#include "tests/support/demand.h"
#include "tests/support/small_cell.h"

namespace trammel {
namespace {

std::shared_ptr<const Cell> cell_among(const std::string& obstacles) {
  return std::make_shared<const Cell>(test::demand(parse_cell(
      test::small_cell_yaml("cell-7") + obstacles, test::small_robot_yaml(), "cell-7.yaml")));
}

constexpr const char* kTable =
    "obstacles:\n  floor_mm: -500\n  mounting: {lower: [-300, -300, -500], upper: [300, 300, 0]}\n"
    "  boxes: {table: {lower: [900, -600, -500], upper: [2100, 600, 900]}}\n";

TEST(Clearance, TheDistanceOfALineFromABoxIsThatOfItsNearestPoint) {
  const Workspace box{{-1, -2, -3}, {1, 2, 3}};
  EXPECT_NEAR(distance_to_box({2, 0, 0}, {5, 0, 0}, box), 1, 1e-9);
  EXPECT_NEAR(distance_to_box({-9, 0, 0}, {9, 0, 0}, box), 0, 1e-9) << "right through";
  EXPECT_NEAR(distance_to_box({2, 3, 0}, {2, 3, 9}, box), std::sqrt(2.0), 1e-9);
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> place(-6, 6);
  const auto point = [&] { return Vector3(place(random), place(random), place(random)); };
  for (int i = 0; i < 200; ++i) {
    const Vector3 from = point(), to = point();
    double least = 1e9;
    for (int k = 0; k <= 4000; ++k) {
      const Vector3 p = from + k / 4000.0 * (to - from);
      least = std::min(least, (p - p.cwiseMax(box.lower).cwiseMin(box.upper)).norm());
    }
    EXPECT_NEAR(distance_to_box(from, to, box), least, 5e-3) << i;
  }
}

TEST(Clearance, NothingTouchesWhereNothingIsStated) {
  const auto cell = cell_among("");
  EXPECT_FALSE(
      Clearance(*cell, cell->tools.begin()->first).touch_at(JointVector::Zero(cell->robot.size())));
  EXPECT_EQ(obstacles_in_words(*cell), "");
}

TEST(Clearance, TheArmTouchesATableThatIsInItsWayAndItsOwnMountingIsLetPass) {
  const auto cell = cell_among(kTable);
  const std::string tool = cell->tools.begin()->first;
  const Clearance clearance(*cell, tool);
  JointVector down = JointVector::Zero(cell->robot.size());
  down(1) = from_deg(60);
  const auto touch = clearance.touch_at(down);
  ASSERT_TRUE(touch);
  EXPECT_GT(touch->link, 0);
  EXPECT_TRUE(touch->what == "box table" || touch->what == "the floor") << touch->what;
  EXPECT_NE(in_words(*touch, cell->robot).find(" touches "), std::string::npos);
  JointVector away = down;
  away(0) = from_deg(120);
  away(1) = from_deg(-20);
  EXPECT_FALSE(clearance.touch_at(away)) << in_words(*clearance.touch_at(away), cell->robot);
  EXPECT_NE(obstacles_in_words(*cell).find("the floor, the mounting, box table; links are taken as "
                                           "100 mm in radius (link_radii_mm is not stated)"),
            std::string::npos)
      << obstacles_in_words(*cell);
}

TEST(Clearance, NoPoseOfAPlanAndNoApproachTouchesWhatIsStatedAndItIsSaid) {
  const auto cell = cell_among(kTable), free = cell_among("");
  const Clearance clearance(*cell, cell->tools.begin()->first);
  const Plan before = test::demand(make_plan(free, {40, 3}));
  const auto touches = [&](const PlannedPose& pose) {
    return clearance.touch_at(pose.context.q) || clearance.touch_at(pose.bump);
  };
  EXPECT_GT(std::count_if(before.poses.begin(), before.poses.end(), touches), 0)
      << "else this cell is no test";
  EXPECT_EQ(before.clear_of, "");
  const Plan plan = test::demand(make_plan(cell, {40, 3}));
  EXPECT_EQ(std::count_if(plan.poses.begin(), plan.poses.end(), touches), 0);
  EXPECT_GT(plan.draw.touching, 0);
  EXPECT_NE(plan.clear_of.find("box table"), std::string::npos);
  const std::string program = test::demand(to_rapid(cell->robot, plan, {}));
  EXPECT_NE(program.find("! poses clear of the floor, the mounting"), std::string::npos);
  EXPECT_NE(test::demand(to_krl(free->robot, before, {})).find("; no obstacle was looked at"),
            std::string::npos);
}

TEST(Clearance, AGivenPoseThatTouchesIsRefusedByItsName) {
  const auto cell = cell_among(kTable);
  const JointList list = test::demand(parse_joint_csv(
      "pose_id,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\nlow,0,60,0,0,10,0\n", "given.csv"));
  const auto plan = plan_of(*cell, test::demand(check_against_cell(list, *cell)));
  ASSERT_FALSE(plan);
  EXPECT_NE(plan.error().message.find("pose low: "), std::string::npos) << plan.error().message;
}

TEST(Clearance, EachLinkAndTheToolHasItsOwnRadius) {
  const auto cell = cell_among(
      "obstacles:\n  boxes: {post: {lower: [5000, 0, 0], upper: [5100, 100, 100]}}\n"
      "  link_radii_mm: [250, 200, 150, 130, 100, 80, 40]\n");
  const Clearance clearance(*cell, cell->tools.begin()->first);
  EXPECT_NEAR(clearance.radius_of({{}, {}, 0}), 0.25, 1e-12);
  EXPECT_NEAR(clearance.radius_of({{}, {}, 6}), 0.04, 1e-12) << "the tool";
  EXPECT_NE(obstacles_in_words(*cell).find("40 to 250 mm in radius"), std::string::npos)
      << obstacles_in_words(*cell);
}

TEST(Clearance, WhatIsMisstatedIsRefused) {
  for (const char* wrong : {"obstacles: {floor: 3}\n", "obstacles: {link_radii_mm: [1, 2]}\n",
                            "obstacles: {boxes: {a: {lower: [1, 0, 0], upper: [0, 1, 1]}}}\n",
                            "obstacles: {link_radii_mm: [-1, 1, 1, 1, 1, 1, 1]}\n"})
    EXPECT_FALSE(parse_cell(test::small_cell_yaml("cell-7") + wrong, test::small_robot_yaml(), "c"))
        << wrong;
}

}  // namespace
}  // namespace trammel
