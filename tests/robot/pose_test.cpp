#include "server/robot/pose.h"

#include <gtest/gtest.h>

#include "server/base/units.h"

namespace trammel {
namespace {

TEST(Pose, LogarithmUndoesExponentialUpToHalfATurn) {
  for (const double angle : {0.0, 1e-14, 1e-8, 1e-3, 1.0, 3.0, kPi - 1e-9}) {
    const Vector3 w = angle * Vector3(1, -2, 0.5).normalized();
    EXPECT_LT((rotation_log(rotation_exp(w)) - w).norm(), 1e-7 * (1 + angle)) << angle;
    EXPECT_NEAR((rotation_exp(w).transpose() * rotation_exp(w) - Matrix3::Identity()).norm(), 0,
                1e-14);
  }
}

TEST(Pose, DifferenceIsMeasuredMinusModelInTheirCommonFrame) {
  const Pose model = make_pose(rotation_exp({0.1, 0.2, 0.3}), {1, 2, 3});
  const Vector3 turn(1e-3, -2e-3, 5e-4);
  const Pose measured = make_pose(rotation_exp(turn) * model.linear(), {1.001, 2, 2.999});
  const Vector6 difference = pose_difference(measured, model);
  EXPECT_LT((difference.head<3>() - Vector3(1e-3, 0, -1e-3)).norm(), 1e-12);
  EXPECT_LT((difference.tail<3>() - turn).norm(), 1e-12);
}

TEST(Pose, BaseTransformationTurnsAboutZThenYThenX) {
  const Pose X = pose_zyx({1, 2, 3}, kPi / 2, 0, kPi / 2);
  EXPECT_LT((X * Vector3::UnitX() - Vector3(1, 3, 3)).norm(), 1e-12);
  EXPECT_LT((X * Vector3::UnitY() - Vector3(1, 2, 4)).norm(), 1e-12);
}

}  // namespace
}  // namespace trammel
