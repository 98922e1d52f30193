#include "server/calibrate/frames/localisation.h"

#include <gtest/gtest.h>

#include <random>

namespace trammel {
namespace {

std::vector<Pose> random_flange_poses(int count, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  const auto vector = [&] { return Vector3(normal(random), normal(random), normal(random)); };
  std::vector<Pose> poses;
  for (int i = 0; i < count; ++i) poses.push_back(make_pose(rotation_exp(vector()), vector()));
  return poses;
}

const Pose kBase = make_pose(rotation_exp({0.5, -2.5, 0.8}), {3, -1, 0.5});
const Pose kTool = make_pose(rotation_exp({-1.2, 0.3, 2.0}), {0.1, -0.2, 0.15});

TEST(Localisation, FindsBaseAndToolFromFullPosesExactly) {
  const std::vector<Pose> X_BF = random_flange_poses(10, 1);
  std::vector<Pose> X_WT;
  for (const Pose& X : X_BF) X_WT.push_back(kBase * X * kTool);
  const Result<BaseAndTool> found = locate_base_and_tool(X_WT, X_BF);
  ASSERT_TRUE(found);
  EXPECT_LT(pose_difference(found->X_WB, kBase).norm(), 1e-9);
  EXPECT_LT(pose_difference(found->X_FT, kTool).norm(), 1e-9);
}

TEST(Localisation, FindsBaseAndToolPointFromPositionsAlone) {
  const std::vector<Pose> X_BF = random_flange_poses(30, 2);
  Eigen::Matrix3Xd p_W(3, 30);
  for (int i = 0; i < 30; ++i)
    p_W.col(i) = (kBase * X_BF[static_cast<std::size_t>(i)] * kTool).translation();
  const Result<BaseAndTool> found = locate_base_and_tool_point(p_W, X_BF);
  ASSERT_TRUE(found);
  EXPECT_LT(pose_difference(found->X_WB, kBase).norm(), 1e-6);
  EXPECT_LT((found->X_FT.translation() - kTool.translation()).norm(), 1e-6);
}

TEST(Localisation, RefusesOrientationsThatTurnAboutOneAxisOnly) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  std::vector<Pose> X_BF;
  std::vector<Pose> X_WT;
  for (int i = 0; i < 20; ++i) {
    X_BF.push_back(make_pose(rotation_exp({0, 0, normal(random)}),
                             {normal(random), normal(random), normal(random)}));
    X_WT.push_back(kBase * X_BF.back() * kTool);
  }
  EXPECT_FALSE(locate_base_and_tool(X_WT, X_BF));
  // The positions still say where the base is, up to a shift along that axis.
  Eigen::Matrix3Xd p_W(3, 20);
  for (int i = 0; i < 20; ++i) p_W.col(i) = X_WT[static_cast<std::size_t>(i)].translation();
  const Result<BaseAndTool> found = locate_base_and_tool_point(p_W, X_BF);
  ASSERT_TRUE(found);
  EXPECT_LT(rotation_log(found->X_WB.linear() * kBase.linear().transpose()).norm(), 1e-6);
  EXPECT_LT((found->X_FT.translation() - kTool.translation()).head<2>().norm(), 1e-6);
  EXPECT_NEAR(found->X_FT.translation().z(), 0, 1e-3);
}

TEST(Localisation, FindsTheToolWhenTheBaseIsKnown) {
  const std::vector<Pose> X_WF = random_flange_poses(4, 4);
  std::vector<Pose> X_WT;
  Eigen::Matrix3Xd p_W(3, 4);
  for (std::size_t i = 0; i < 4; ++i) {
    X_WT.push_back(X_WF[i] * kTool);
    p_W.col(static_cast<int>(i)) = X_WT.back().translation();
  }
  EXPECT_LT(pose_difference(*locate_tool(X_WT, X_WF), kTool).norm(), 1e-10);
  EXPECT_LT((*locate_tool_point(p_W, X_WF) - kTool.translation()).norm(), 1e-10);
  EXPECT_FALSE(locate_tool({}, {}));
}

}  // namespace
}  // namespace trammel
