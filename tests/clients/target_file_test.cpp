#include "clients/cli/files/target_file.h"

#include <gtest/gtest.h>

#include "server/base/units.h"
#include "server/exchange/si.h"
#include "tests/support/refusal.h"
#include "tests/support/small_cell.h"

namespace trammel::cli {
namespace {

using test::Refusal;
using test::refusal_of;

const std::string kPose = "x_mm,y_mm,z_mm,qw,qx,qy,qz";

Refusal refusal(const std::string& text) {
  const auto file = parse_targets_csv(text, "t.csv");
  return refusal_of(file);
}

TEST(TargetFile, ReadsPosesWithABranch) {
  const auto file =
      parse_targets_csv("conf," + kPose + ",note\n3,1000,-200,1500,0,1,0,0,hole 7\n", "t.csv");
  ASSERT_TRUE(file) << file.error().message;
  ASSERT_EQ(file->rows.size(), 1u);
  const exchange::AskedTarget& target = file->rows[0].target;
  EXPECT_EQ(file->rows[0].row, 2);
  EXPECT_EQ(target.conf, 3);
  EXPECT_TRUE(target.seed_rad.empty());
  EXPECT_FALSE(target.joint_target);
  EXPECT_EQ(target.pose.xyz_mm, (std::array<double, 3>{1000, -200, 1500}));
  EXPECT_TRUE(exchange::to_si(target.pose)
                  .linear()
                  .isApprox(Vector3(1, -1, -1).asDiagonal().toDenseMatrix()));
}

TEST(TargetFile, RefusesWhatWasCorrectedAlready) {
  const std::string header = "conf," + kPose + ",status,error_before_mm,error_after_mm,model_id\n";
  const auto again =
      parse_targets_csv(header + "3,1000,-200,1500,0,1,0,0,ok,0.7,0.01,m1\n", "t.csv");
  ASSERT_FALSE(again);
  EXPECT_EQ(again.error().field, "model_id");
  EXPECT_NE(again.error().message.find("m1"), std::string::npos) << again.error().message;
  EXPECT_TRUE(
      parse_targets_csv("conf," + kPose + ",status\n3,1000,-200,1500,0,1,0,0,ok\n", "t.csv"));
}

TEST(TargetFile, ReadsPosesWithASeed) {
  const auto file = parse_targets_csv(kPose + ",q1_deg,q2_deg\n1,2,3,1,0,0,0,90,-45\n", "t.csv");
  ASSERT_TRUE(file) << file.error().message;
  EXPECT_EQ(file->rows[0].target.seed_rad, (std::vector{kPi / 2, -kPi / 4}));
  EXPECT_FALSE(file->rows[0].target.conf);
}

TEST(TargetFile, EachRowMaySayItsBranchInItsOwnWay) {
  const auto file =
      parse_targets_csv(kPose + ",conf,q1_deg\n1,2,3,1,0,0,0,5,\n1,2,3,1,0,0,0,,90\n", "t.csv");
  ASSERT_TRUE(file) << file.error().message;
  EXPECT_EQ(file->rows[0].target.conf, 5);
  EXPECT_TRUE(file->rows[0].target.seed_rad.empty());
  EXPECT_FALSE(file->rows[1].target.conf);
  EXPECT_FALSE(file->rows[1].target.seed_rad.empty());
}

TEST(TargetFile, ReadsJointTargetsAlone) {
  const auto file = parse_targets_csv("q1_deg,q2_mm\n180,250\n", "t.csv");
  ASSERT_TRUE(file) << file.error().message;
  EXPECT_TRUE(file->rows[0].target.joint_target);
  EXPECT_EQ(file->rows[0].target.seed_rad, (std::vector{kPi, 250.}));
}

TEST(TargetFile, ReadsHowTheArmComesToATarget) {
  const auto file = parse_targets_csv(
      "conf," + kPose + ",dir1,dir2,temperature_c,time_s\n3,1,2,3,1,0,0,0,1,-1,31.5,60\n", "t.csv");
  ASSERT_TRUE(file) << file.error().message;
  const exchange::AskedTarget& target = file->rows[0].target;
  EXPECT_EQ(target.approach.directions, (std::vector<int>{1, -1}));
  EXPECT_EQ(target.approach.temperature_c, 31.5);
  EXPECT_EQ(target.approach.time_s, 60);
  EXPECT_EQ(refusal_of(check_targets(*file, test::small_cell("cell-7")->robot)),
            Refusal("t.csv", {}, "dir2").beyond(2, 6));
  EXPECT_EQ(refusal("conf," + kPose + ",dir1\n3,1,2,3,1,0,0,0,2\n").of(ErrorCode::kRefused),
            Refusal("t.csv", 2, "dir1").beyond(2, 1));
}

TEST(TargetFile, RefusesWhatIsNoTarget) {
  EXPECT_EQ(refusal(""), Refusal("t.csv").beyond(0, 1));
  EXPECT_EQ(refusal("a,b\n1,2\n"), Refusal("t.csv", {}, "x_mm"));
  EXPECT_EQ(refusal(kPose + "\n1,2,3,1,0,0,0\n"), Refusal("t.csv", {}, "conf"));
  EXPECT_EQ(refusal("x_mm,y_mm,q1_deg\n1,2,3\n"), Refusal("t.csv", {}, "z_mm"));
  EXPECT_EQ(refusal(kPose + ",conf\n"), Refusal("t.csv").beyond(0, 1));
  EXPECT_EQ(refusal(kPose + ",conf\n1,2,3,1,0,0,0,\n"), Refusal("t.csv", 2, "conf"));
  EXPECT_EQ(refusal(kPose + ",conf\n1,2,3,1,0,0,0,8\n"), Refusal("t.csv", 2, "conf").beyond(8, 7));
  EXPECT_EQ(refusal(kPose + ",conf\n1,2,3,1,0,0,0.1,1\n"),
            Refusal("t.csv", 2, "qw").beyond(1.00499, 1));
  EXPECT_EQ(refusal("q1_deg\n1\nnan\n"), Refusal("t.csv", 3, "q1_deg").text("nan"));
}

TEST(TargetFile, IsHeldAgainstTheRobot) {
  const Chain robot = test::small_cell("c")->robot;
  const auto check = [&](const std::string& text, const Chain& chain) {
    const Status checked = check_targets(parse_targets_csv(text, "t.csv").value(), chain);
    return refusal_of(checked);
  };
  EXPECT_EQ(check(kPose + ",conf\n1001,2,3,1,0,0,0,1\n", robot), Refusal::none());
  EXPECT_EQ(check("q1_deg,q2_deg\n1,2\n", robot), Refusal("t.csv").beyond(2, 6));
  const Chain one = Chain::make("turntable", {Joint{}}).value();
  EXPECT_EQ(check("q1_deg\n1\n", one), Refusal::none());
  EXPECT_EQ(check(kPose + ",conf\n1,2,3,1,0,0,0,1\n", one), Refusal("t.csv", 2, "conf").value(1));
}

TEST(TargetFile, PositionsThatAllLookLikeMetresAreRefused) {
  const Chain robot = test::small_cell("c")->robot;
  const auto check = [&](const std::string& rows, const Chain& chain) {
    return check_targets(parse_targets_csv(kPose + ",conf\n" + rows, "t.csv").value(), chain);
  };
  const std::string metres = "1.5,0.2,1.1,1,0,0,0,1\n1.6,-2.2,1.1,1,0,0,0,1\n";
  const Status refused = check(metres, robot);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refusal_of(refused), Refusal("t.csv", 2, "x_mm").beyond(1.5, 10));
  EXPECT_NE(refused.error().message.find("look like metres"), std::string::npos)
      << refused.error().message;
  EXPECT_TRUE(check(metres + "1500,200,1100,1,0,0,0,1\n", robot)) << "one is not";
  EXPECT_TRUE(check("1500,200,1100,1,0,0,0,1\n", robot));
  Joint x, y, z;
  for (Joint* axis : {&x, &y, &z}) axis->type = JointType::kPrismatic;
  const auto gantry = Chain::make("gantry", {x, y, z});
  ASSERT_TRUE(gantry);
  const Status known = check("1.5,0.2,1.1,1,0,0,0,1\n", *gantry);
  EXPECT_TRUE(known || known.error().field == "conf") << "a gantry may work about its zero";
}

}  // namespace
}  // namespace trammel::cli
