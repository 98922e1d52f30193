#include "server/robot/rigid_fit.h"

#include <gtest/gtest.h>

#include "tests/support/refusal.h"

namespace trammel {
namespace {

using test::Refusal;
using test::refusal_of;

const Pose kTruth = make_pose(rotation_exp({0.5, -2.5, 0.8}), {3, -1, 0.5});

Eigen::Matrix3Xd moved(const Eigen::Matrix3Xd& p) {
  return (kTruth.linear() * p).colwise() + kTruth.translation();
}

TEST(RigidFit, FindsTheDirectMapExactly) {
  const Eigen::Matrix3Xd p_B = Eigen::Matrix3Xd::Random(3, 5);
  EXPECT_LT(pose_difference(*fit_transform(moved(p_B), p_B), kTruth).norm(), 1e-10);
}

TEST(RigidFit, FindsARotationAndNoMirrorFromPointsInAPlane) {
  Eigen::Matrix3Xd p_B = Eigen::Matrix3Xd::Random(3, 5);
  p_B.row(2).setZero();
  const Result<Pose> found = fit_transform(moved(p_B), p_B);
  ASSERT_TRUE(found) << found.error().message;
  EXPECT_LT(pose_difference(*found, kTruth).norm(), 1e-10);
}

TEST(RigidFit, RefusesTooFewPointsAndPointsOnALine) {
  Eigen::Matrix3Xd p_B = Eigen::Matrix3Xd::Random(3, 5);
  const auto few = fit_transform(p_B.leftCols(2), p_B.leftCols(2));
  ASSERT_FALSE(few);
  EXPECT_EQ(refusal_of(few), Refusal().beyond(2, 3));
  for (int i = 0; i < 5; ++i) p_B.col(i) = i * Vector3(1, 2, 3);
  const auto line = fit_transform(p_B, p_B);
  ASSERT_FALSE(line);
  EXPECT_EQ(refusal_of(line), Refusal());
}

}  // namespace
}  // namespace trammel
