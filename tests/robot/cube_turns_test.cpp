#include "server/robot/cube_turns.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "server/base/units.h"

namespace trammel {
namespace {

TEST(CubeTurns, EveryRotationIsNearOneOfThem) {
  ASSERT_EQ(cube_turns().size(), 24u);
  EXPECT_TRUE(cube_turns().front().isIdentity());
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  double farthest = 0;
  for (int k = 0; k < 2000; ++k) {
    const Matrix3 R =
        Eigen::Quaterniond(normal(random), normal(random), normal(random), normal(random))
            .normalized()
            .matrix();
    double nearest = kPi;
    for (const Matrix3& turn : cube_turns())
      nearest = std::min(nearest, Eigen::AngleAxisd(Matrix3(turn.transpose() * R)).angle());
    farthest = std::max(farthest, nearest);
  }
  EXPECT_LT(to_deg(farthest), 63);
  EXPECT_GT(to_deg(farthest), 50) << "no more of them than a cube has";
}

TEST(CubeTurns, ATurnAboutAPointLeavesThePointWhereItIs) {
  const Pose X_AB = make_pose(rotation_exp({0.3, -1.2, 0.4}), {0.1, 2, -3});
  const Vector3 p_A(0.5, -0.7, 0.9);
  const Vector3 p_B = X_AB.inverse() * p_A;
  for (const Matrix3& turn : cube_turns()) {
    const Pose turned = turned_about(p_A, turn, X_AB);
    EXPECT_LT((turned * p_B - p_A).norm(), 1e-12);
    EXPECT_LT((turned.linear() - turn * X_AB.linear()).norm(), 1e-12);
  }
}

}  // namespace
}  // namespace trammel
