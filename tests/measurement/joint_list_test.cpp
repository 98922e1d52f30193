#include "server/measurement/files/joint_list.h"

#include <gtest/gtest.h>

#include "server/base/units.h"

namespace trammel {
namespace {

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

std::string refusal(const std::string& text) {
  const auto list =
      parse_joint_csv(text, "j.csv").and_then([](const JointList& read) { return check_against_cell(read, cell()); });
  return list ? "accepted" : list.error().message;
}

TEST(JointList, ReadsJointsAndTheirCircumstances) {
  const auto list = parse_joint_csv("pose_id,q1_mm,q2_deg,tool_id,note\nup,1500,45,hook,x\n", "j.csv");
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
      "pose_id,q1_mm,q2_deg,dir1,dir2,tool_id,payload_id\n1,1500,45.25,-1,1,hook,full\n2,0,-90,0,-1,,empty\n";
  const auto list = parse_joint_csv(text, "j.csv");
  ASSERT_TRUE(list) << list.error().message;
  EXPECT_EQ(to_csv(*list), text);
}

TEST(JointList, ResolvesTheOnlyTool) {
  const auto list = check_against_cell(parse_joint_csv("q1_mm,q2_deg\n1,2\n", "j.csv").value(), cell());
  ASSERT_TRUE(list) << list.error().message;
  EXPECT_EQ(list->poses[0].context.tool, "hook");
}

TEST(JointList, RefusesWhatDoesNotFitTheRobot) {
  EXPECT_EQ(refusal("q1_mm,q2_deg\n1,2\n"), "accepted");
  EXPECT_EQ(refusal("q1_mm\n1\n"), "j.csv: 1 joint columns, robot crane has 2");
  EXPECT_EQ(refusal("q1_deg,q2_deg\n1,2\n"),
            "j.csv: column q1_deg, but joint 1 of robot crane is prismatic: expected q1_mm");
  EXPECT_EQ(refusal("q1_mm,q2_deg\n1,2\n-5,2\n"), "j.csv row 3: joint 1 is -5 mm, limit 0 mm");
  EXPECT_EQ(refusal("q1_mm,q2_deg\n1,2\n1,90.5\n"), "j.csv row 3: joint 2 is 90.5 deg, limit 90 deg");
  EXPECT_EQ(refusal("q1_mm,q2_deg,tool_id\n1,2,saw\n"), "j.csv row 2: cell cell-2: unknown tool 'saw'; known: hook");
  EXPECT_EQ(refusal("a,b\n1,2\n"), "j.csv: missing column q1_deg; the header has: a,b");
  EXPECT_EQ(refusal("q1_mm,q2_deg\n"), "j.csv: no poses below the header, at least 1 is needed");
}

}  // namespace
}  // namespace trammel
