#include "server/robot/offset_wrist.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "server/base/units.h"
#include "server/robot/cell.h"
#include "server/robot/inverse_kinematics.h"

namespace trammel {
namespace {

Chain shipped_wrist(const std::string& name) {
  const Result<Chain> chain =
      read_robot(std::string(TRAMMEL_SOURCE_DIR "/models/") + name + ".yaml");
  EXPECT_TRUE(chain) << name;
  return *chain;
}

const std::vector<std::string> kOffset = {"universal-robots_ur10", "universal-robots_ur5"};

TEST(OffsetWrist, OnlyArmsWithThreeParallelAxesHaveOne) {
  for (const std::string& name : kOffset)
    EXPECT_TRUE(has_offset_wrist(shipped_wrist(name))) << name;
  for (const char* name :
       {"abb_irb6640-205-275", "kuka_lbr-iiwa-7-r800", "abb_irb6640-205-275-on-rail"})
    EXPECT_FALSE(has_offset_wrist(shipped_wrist(name))) << name;
}

TEST(OffsetWrist, EveryBranchBringsTheFlangeThereAndOneOfThemIsTheArms) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> angle(-3, 3);
  for (const std::string& name : kOffset) {
    const Chain chain = shipped_wrist(name);
    for (int pose = 0; pose < 200; ++pose) {
      JointVector q(6);
      for (int j = 0; j < 6; ++j) q(j) = angle(random);
      const Pose X_BF = chain.flange_pose(q);
      int own = 0, found = 0;
      for (int branch = 0; branch < 8; ++branch) {
        const auto joints = joints_of_offset_wrist(chain, X_BF, branch, q);
        if (!joints) continue;
        ++found;
        EXPECT_LT(pose_difference(chain.flange_pose(*joints), X_BF).norm(), 1e-9)
            << name << " branch " << branch;
        own += (*joints - q).norm() < 1e-7 ? 1 : 0;
      }
      EXPECT_EQ(own, 1) << name << " pose " << pose << " of " << found;
    }
  }
}

/// An oracle that shares nothing: descents from many places end at the same eight.
TEST(OffsetWrist, NothingThatADescentFindsIsMissing) {
  const Chain chain = shipped_wrist("universal-robots_ur10");
  std::mt19937 random(11);
  std::uniform_real_distribution<double> angle(-3, 3);
  JointVector q(6);
  q << 0.7, -1.3, 1.6, -1.9, 1.1, 0.4;
  const Pose X_BF = chain.flange_pose(q);
  for (int start = 0; start < 200; ++start) {
    JointVector seed(6);
    for (int j = 0; j < 6; ++j) seed(j) = angle(random);
    const InverseResult found = inverse_kinematics(chain, X_BF, seed);
    if (found.status != InverseStatus::kOk) continue;
    bool known = false;
    for (int branch = 0; branch < 8; ++branch) {
      const auto joints = joints_of_offset_wrist(chain, X_BF, branch, found.q);
      known |= joints && (*joints - found.q).norm() < 1e-6;
    }
    EXPECT_TRUE(known) << found.q.transpose();
  }
}

TEST(OffsetWrist, WhereAxes4And6AreParallelJoint6Stays) {
  const Chain chain = shipped_wrist("universal-robots_ur10");
  JointVector q(6);
  q << 0.7, -1.3, 1.6, -1.9, 0, 0.4;
  int own = 0;
  for (int branch = 0; branch < 8; ++branch) {
    const auto joints = joints_of_offset_wrist(chain, chain.flange_pose(q), branch, q);
    own += joints && (*joints - q).norm() < 1e-6 ? 1 : 0;
  }
  EXPECT_EQ(own, 2) << "joint 5 is neither positive nor negative";
}

TEST(OffsetWrist, OutOfReachIsNoBranch) {
  const Chain chain = shipped_wrist("universal-robots_ur10");
  for (const Vector3& p : {Vector3(2, 0, 0), Vector3(.01, 0, .5)}) {
    for (int branch = 0; branch < 8; ++branch)
      EXPECT_FALSE(joints_of_offset_wrist(chain, make_pose(Matrix3::Identity(), p), branch,
                                          JointVector::Zero(6)));
  }
}

}  // namespace
}  // namespace trammel
