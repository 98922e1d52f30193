#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <random>
#include <unsupported/Eigen/EulerAngles>

#include "clients/cli/files/shown_pose_file.h"
#include "server/base/hash.h"
#include "server/base/units.h"
#include "server/robot/robot_confirmation.h"
#include "server/robot/shown_poses.h"

namespace trammel::cli {
namespace {

using Verdict = RobotComparison::Verdict;

Cell cell_with(const std::string& robot, const std::string& tools = "tools: {gripper: null}\n",
               const std::string& base = "null") {
  std::ifstream file(std::string(TRAMMEL_SOURCE_DIR) + "/models/" + robot);
  const std::string robot_yaml((std::istreambuf_iterator<char>(file)),
                               std::istreambuf_iterator<char>());
  const Result<Cell> cell = parse_cell(
      "version: 1\ncell: shown\nrobot: r.yaml\nbase: " + base + "\n" + tools, robot_yaml, "cell");
  EXPECT_TRUE(cell) << sentence(cell.error());
  return *cell;
}

/// The way in which a controller writes angles.
enum class Angles { kKuka, kFanuc, kUniversalRobots, kStaubli };

Vector3 angles_of(const Matrix3& R, Angles kind) {
  switch (kind) {
    case Angles::kKuka:
      return Eigen::EulerAngles<double, Eigen::EulerSystemZYX>(R).angles();
    case Angles::kFanuc: {
      const Vector3 zyx = Eigen::EulerAngles<double, Eigen::EulerSystemZYX>(R).angles();
      return {zyx(2), zyx(1), zyx(0)};
    }
    case Angles::kUniversalRobots:
      return rotation_log(R);
    case Angles::kStaubli:
      return Eigen::EulerAngles<double, Eigen::EulerSystemXYZ>(R).angles();
  }
  return {};
}

struct Controller {
  Chain robot;
  Angles angles = Angles::kKuka;
  Pose X_SB = Pose::Identity(), X_FT = Pose::Identity();
  std::string header = "A1,A2,A3,A4,A5,A6,X,Y,Z,A,B,C";
  int decimals = 3;
};

/// The controller's screen at some poses, each number rounded as there.
std::string screen(const Controller& controller, int poses = 6, double reach_deg = 60) {
  std::mt19937_64 random(11);
  std::uniform_real_distribution<double> angle(-reach_deg, reach_deg);
  const double rounding = std::pow(10, controller.decimals);
  std::string text = controller.header + "\n";
  for (int i = 0; i < poses; ++i) {
    JointVector q(controller.robot.size());
    for (double& value : q) value = std::round(angle(random) * rounding) / rounding;
    for (const double value : q) text += fmt::format("{:.{}f},", value, controller.decimals);
    const Pose X =
        controller.X_SB * controller.robot.flange_pose(q * from_deg(1)) * controller.X_FT;
    const Vector3 p = 1e3 * X.translation(),
                  a = angles_of(X.linear(), controller.angles) * to_deg(1);
    text += fmt::format("{:.2f},{:.2f},{:.2f},{:.3f},{:.3f},{:.3f}\n", p.x(), p.y(), p.z(), a.x(),
                        a.y(), a.z());
  }
  return text;
}

RobotComparison compared(const Cell& cell, const std::string& text) {
  const Result<ShownPoses> shown = parse_shown_poses(text, "shown.csv", cell.robot);
  EXPECT_TRUE(shown) << sentence(shown.error());
  const Result<RobotComparison> found = compare_robot(cell, *shown);
  EXPECT_TRUE(found) << sentence(found.error());
  return *found;
}

/// The robot with one link's number changed.
Chain altered(const Chain& robot, int joint, double LinkGeometry::*number, double by) {
  std::vector<Joint> joints;
  for (int j = 0; j < robot.size(); ++j) joints.push_back(robot.joint(j));
  joints[static_cast<std::size_t>(joint)].link.*number += by;
  return *Chain::make(robot.name(), joints, robot.couplings());
}

class EveryMakersAngles
    : public testing::TestWithParam<std::tuple<std::string, Angles, std::string>> {};

TEST_P(EveryMakersAngles, AreReadAsTheyAreMeant) {
  const auto& [robot, angles, header] = GetParam();
  const Cell cell = cell_with(robot);
  const RobotComparison found =
      compared(cell, screen({cell.robot, angles, Pose::Identity(), Pose::Identity(), header}));
  EXPECT_EQ(found.verdict, Verdict::kConfirmed) << found.why;
  EXPECT_LT(found.position_max, 0.1e-3);
  EXPECT_LT(found.rotation_max, from_deg(0.02));
  EXPECT_EQ(found.shown_as, "the flange in the robot's base");
}

INSTANTIATE_TEST_SUITE_P(
    ConfirmRobot, EveryMakersAngles,
    testing::Values(
        std::tuple("kuka_kr210-r2700-extra.yaml", Angles::kKuka, "A1,A2,A3,A4,A5,A6,X,Y,Z,A,B,C"),
        std::tuple("fanuc_m-20ia.yaml", Angles::kFanuc, "J1,J2,J3,J4,J5,J6,X,Y,Z,W,P,R"),
        std::tuple("universal-robots_ur5.yaml", Angles::kUniversalRobots,
                   "J1,J2,J3,J4,J5,J6,X,Y,Z,Rx,Ry,Rz"),
        std::tuple("staubli_tx2-90l.yaml", Angles::kStaubli, "J1,J2,J3,J4,J5,J6,X,Y,Z,RX,RY,RZ"),
        std::tuple("abb_irb6640-205-275.yaml", Angles::kKuka,
                   "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,x_mm,y_mm,z_mm,a_deg,b_deg,c_deg")));

TEST(ConfirmRobot, NamesTheNumberThatIsNotTheControllers) {
  const Cell cell = cell_with("abb_irb6640-205-275.yaml");
  const RobotComparison found =
      compared(cell, screen({altered(cell.robot, 3, &LinkGeometry::d, 0.020)}));
  EXPECT_EQ(found.verdict, Verdict::kDiffers);
  EXPECT_NEAR(found.position_max, 0.020, 1e-3);
  ASSERT_EQ(found.could_be.size(), 1U) << found.could_be.front();
  EXPECT_NE(found.could_be.front().find("d_mm of joint 4"), std::string::npos)
      << found.could_be.front();
}

TEST(ConfirmRobot, FindsASignAZeroAndACoupling) {
  const Cell cell = cell_with("abb_irb6640-205-275.yaml");
  const auto first = [&](const Chain& robot) {
    const RobotComparison found = compared(cell, screen({robot}));
    EXPECT_EQ(found.verdict, Verdict::kDiffers);
    return found.could_be.empty() ? std::string("nothing") : found.could_be.front();
  };
  std::vector<Joint> joints;
  for (int j = 0; j < 6; ++j) joints.push_back(cell.robot.joint(j));
  std::vector<Joint> turned = joints;
  turned[4].sign *= -1;
  EXPECT_NE(first(*Chain::make("turned", turned)).find("sign of joint 5"), std::string::npos);
  EXPECT_NE(
      first(altered(cell.robot, 1, &LinkGeometry::theta, from_deg(1))).find("theta_deg of joint 2"),
      std::string::npos);
  EXPECT_NE(first(*Chain::make("coupled", joints, {{2, 1, 1.0}})).find("joint 3 follows joint 2"),
            std::string::npos);
}

TEST(ConfirmRobot, AnotherRobotOfTheFamilyIsNotTheFilesOne) {
  const Cell cell = cell_with("universal-robots_ur5.yaml");
  Chain other = altered(cell.robot, 0, &LinkGeometry::d, 0.0733);
  other = altered(other, 3, &LinkGeometry::d, 0.02415);
  other = altered(other, 4, &LinkGeometry::d, 0.00505);
  other = altered(other, 5, &LinkGeometry::d, 0.0173);
  const RobotComparison found =
      compared(cell, screen({other, Angles::kUniversalRobots, Pose::Identity(), Pose::Identity(),
                             "J1,J2,J3,J4,J5,J6,X,Y,Z,Rx,Ry,Rz"}));
  EXPECT_EQ(found.verdict, Verdict::kDiffers) << found.why;
  EXPECT_EQ(found.could_be.size(), 4U) << fmt::format("{}", fmt::join(found.could_be, "; "));
}

TEST(ConfirmRobot, KnowsToolsAndBasesOfTheCell) {
  const Cell cell =
      cell_with("kuka_kr210-r2700-extra.yaml", "tools: {gripper: {xyz_mm: [10, 20, 150]}}\n",
                "{xyz_mm: [0, 0, 800]}");
  Controller controller{cell.robot};
  controller.X_FT = *cell.tools.at("gripper");
  controller.X_SB = *cell.X_WB;
  const RobotComparison found = compared(cell, screen(controller));
  EXPECT_EQ(found.verdict, Verdict::kConfirmed) << found.why;
  EXPECT_EQ(found.shown_as, "tool gripper in the cell's base");
}

TEST(ConfirmRobot, ForeignFramesHideTheEndsOfTheArm) {
  const Cell cell = cell_with("kuka_kr210-r2700-extra.yaml");
  Controller controller{cell.robot};
  controller.X_FT.translation() = Vector3(0.1, -0.05, 0.2);
  controller.X_FT.rotate(Eigen::AngleAxisd(0.7, Vector3::UnitY()));
  controller.X_SB.translation() = Vector3(-1, 2, 0.5);
  const RobotComparison found = compared(cell, screen(controller));
  EXPECT_EQ(found.verdict, Verdict::kCannotTell);
  EXPECT_NE(found.why.find("tool 0"), std::string::npos) << found.why;
}

TEST(ConfirmRobot, SaysWhatThePosesDoNotShow) {
  const Cell cell = cell_with("kuka_kr210-r2700-extra.yaml");
  Controller rough{cell.robot};
  rough.decimals = 0;
  EXPECT_EQ(compared(cell, screen(rough)).verdict, Verdict::kCannotTell);
  EXPECT_EQ(compared(cell, screen({cell.robot}, 6, 2)).verdict, Verdict::kCannotTell);
  const std::string whole = screen({cell.robot});
  std::string positions;
  for (std::size_t at = 0; at < whole.size();) {
    const std::size_t end = whole.find('\n', at);
    std::size_t cut = end;
    for (int k = 0; k < 3; ++k) cut = whole.rfind(',', cut - 1);
    positions += whole.substr(at, cut - at) + "\n";
    at = end + 1;
  }
  const RobotComparison found = compared(cell, positions);
  EXPECT_EQ(found.verdict, Verdict::kCannotTell);
  EXPECT_NE(found.why.find("no orientation"), std::string::npos) << found.why;
  EXPECT_FALSE(compare_robot(cell, *parse_shown_poses(screen({cell.robot}, 2), "two", cell.robot)));
}

TEST(ConfirmRobot, AConfirmationHoldsForTheRobotFileThatWasCompared) {
  Cell cell = cell_with("kuka_kr210-r2700-extra.yaml");
  EXPECT_FALSE(confirmation_of(cell));
  const Result<std::string> text = with_confirmation(
      cell, RobotConfirmation{sha256_hex(cell.robot_yaml), 6, 0.01, 0.002, "2026-11-26"});
  ASSERT_TRUE(text);
  const Cell confirmed = *parse_cell(*text, cell.robot_yaml, "cell");
  ASSERT_TRUE(confirmation_of(confirmed));
  EXPECT_EQ(confirmation_of(confirmed)->poses, 6);
  EXPECT_FALSE(confirmation_of(*parse_cell(*text, cell.robot_yaml + "# mended\n", "cell")))
      << "of another robot file";
  EXPECT_EQ(*with_confirmation(confirmed, std::nullopt), cell.cell_yaml) << "taken back";
}

}  // namespace
}  // namespace trammel::cli
