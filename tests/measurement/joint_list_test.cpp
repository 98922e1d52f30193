#include "server/measurement/files/joint_list.h"

#include <gtest/gtest.h>

#include <cmath>

#include "server/base/units.h"
#include "tests/support/refusal.h"
#include "tests/support/virtual_robot.h"

namespace trammel {
namespace {

using test::Refusal;
using test::refusal_of;

Cell cell() {
  Cell cell;
  cell.name = "cell-2";
  Joint turn, rail;
  turn.lower = from_deg(-90);
  turn.upper = from_deg(90);
  rail.type = JointType::kPrismatic;
  rail.lower = 0;
  rail.upper = 3;
  cell.robot = Chain::make("crane", {rail, turn}).value();
  cell.tools["hook"] = Pose::Identity();
  return cell;
}

Refusal refusal(const std::string& text) {
  const auto list = parse_joint_csv(text, "j.csv").and_then([](const JointList& read) {
    return check_against_cell(read, cell());
  });
  return refusal_of(list);
}

TEST(JointList, ReadsJointsAndTheirCircumstances) {
  const auto list =
      parse_joint_csv("pose_id,q1_mm,q2_deg,tool_id,note\nup,1500,45,hook,x\n", "j.csv");
  ASSERT_TRUE(list) << list.error().message;
  ASSERT_EQ(list->poses.size(), 1u);
  EXPECT_EQ(list->poses[0].pose_id, "up");
  EXPECT_TRUE(list->poses[0].context.q.isApprox(Eigen::Vector2d(1.5, kPi / 4)));
  EXPECT_EQ(list->poses[0].context.tool, "hook");
}

TEST(JointList, WhatIsWrittenReadsBackTheSame) {
  const std::string text = "pose_id,q1_mm,q2_deg\na,1500,45.25\n\"b, c\",0,-90\n";
  const auto list = parse_joint_csv(text, "j.csv");
  ASSERT_TRUE(list) << list.error().message;
  EXPECT_EQ(to_csv(*list), text);
}

TEST(JointList, WritesWhatIsKnownOfEachPose) {
  const std::string text =
      "pose_id,q1_mm,q2_deg,dir1,dir2,tool_id,payload_id\n1,1500,45.25,-1,1,hook,full\n2,0,-90,0,-"
      "1,,empty\n";
  const auto list = parse_joint_csv(text, "j.csv");
  ASSERT_TRUE(list) << list.error().message;
  EXPECT_EQ(to_csv(*list), text);
}

TEST(JointList, OneInRadiansIsRefusedWithItsUnitAndOneNearAPlaceIsNot) {
  const auto of_six = [](double size) {
    std::string text = "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n";
    for (int row = 0; row < 8; ++row)
      text += fmt::format("{0:.4f},{1:.4f},{0:.4f},{1:.4f},{2:.4f},{2:.4f}\n", size * std::sin(row),
                          size * 0.5 * std::cos(row), size * std::sin(2.0 * row));
    return parse_joint_csv(text, "j.csv").and_then([](const JointList& read) {
      return check_against_cell(read, *test::cell_7());
    });
  };
  const auto radians = of_six(3);
  ASSERT_FALSE(radians);
  EXPECT_EQ(refusal_of(radians), Refusal("j.csv", {}, "q1_deg"));
  EXPECT_NE(radians.error().next.find("radians"), std::string::npos);
  EXPECT_TRUE(of_six(0.9)) << "all within a degree";
  EXPECT_TRUE(of_six(25)) << "some farther than radians go";
}

TEST(JointList, ResolvesTheOnlyTool) {
  const auto list =
      check_against_cell(parse_joint_csv("q1_mm,q2_deg\n1,2\n", "j.csv").value(), cell());
  ASSERT_TRUE(list) << list.error().message;
  EXPECT_EQ(list->poses[0].context.tool, "hook");
}

TEST(JointList, RefusesWhatDoesNotFitTheRobot) {
  EXPECT_EQ(refusal("q1_mm,q2_deg\n1,2\n"), Refusal::none());
  EXPECT_EQ(refusal("q1_mm\n1\n"), Refusal("j.csv").beyond(1, 2));
  EXPECT_EQ(refusal("q1_deg,q2_deg\n1,2\n"), Refusal("j.csv", {}, "q1_deg"));
  EXPECT_EQ(refusal("q1_mm,q2_deg\n1,2\n-5,2\n"), Refusal("j.csv", 3, "q1_mm").beyond(-5, 0));
  EXPECT_EQ(refusal("q1_mm,q2_deg\n1,2\n1,90.5\n"), Refusal("j.csv", 3, "q2_deg").beyond(90.5, 90));
  EXPECT_EQ(refusal("q1_mm,q2_deg,tool_id\n1,2,saw\n"), Refusal("j.csv", 2, "tool_id").text("saw"));
  EXPECT_EQ(refusal("a,b\n1,2\n"), Refusal("j.csv", {}, "q1_deg"));
  EXPECT_EQ(refusal("q1_mm,q2_deg\n"), Refusal("j.csv").beyond(0, 1));
}

}  // namespace
}  // namespace trammel
