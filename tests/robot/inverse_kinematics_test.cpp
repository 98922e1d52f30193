#include "server/robot/inverse_kinematics.h"

#include <gtest/gtest.h>

#include <random>
#include <set>

#include "server/base/units.h"
#include "server/robot/cell.h"
#include "tests/support/refusal.h"

namespace trammel {
namespace {

using test::Refusal;
using test::refusal_of;

Chain shipped(const std::string& file) {
  return *read_robot(std::string(TRAMMEL_SOURCE_DIR) + "/models/" + file);
}

JointVector inside_limits(const Chain& chain, std::mt19937_64& random) {
  JointVector q(chain.size());
  for (int i = 0; i < chain.size(); ++i) {
    q(i) =
        std::uniform_real_distribution<double>(chain.joint(i).lower, chain.joint(i).upper)(random);
  }
  return q;
}

TEST(InverseKinematics, FindsTheJointsAgainFromASeedNearby) {
  std::mt19937_64 random(1);
  std::normal_distribution<double> near(0, 0.05);
  for (const char* file : {"abb_irb6640-205-275.yaml", "universal-robots_ur10.yaml"}) {
    const Chain chain = shipped(file);
    int reached = 0;
    for (int k = 0; k < 200; ++k) {
      const JointVector q = inside_limits(chain, random);
      JointVector seed = q;
      for (int i = 0; i < chain.size(); ++i) seed(i) += near(random);
      const Pose wanted = chain.flange_pose(q);
      const InverseResult found = inverse_kinematics(chain, wanted, seed);
      if (found.status == InverseStatus::kSingular) continue;
      ASSERT_EQ(found.status, InverseStatus::kOk) << file << " pose " << k;
      EXPECT_LT(pose_difference(wanted, chain.flange_pose(found.q)).norm(), 1e-9);
      EXPECT_FALSE(chain.joint_outside_limits(found.q));
      ++reached;
    }
    EXPECT_GT(reached, 190) << file;
  }
}

TEST(InverseKinematics, EachBranchReachesThePoseAndIsRecognisedAgain) {
  std::mt19937_64 random(2);
  const Chain chain = shipped("abb_irb6640-205-275.yaml");
  std::set<int> seen;
  for (int k = 0; k < 200; ++k) {
    const JointVector q = inside_limits(chain, random);
    const Pose wanted = chain.flange_pose(q);
    const int branch = *branch_of(chain, q);
    const InverseResult same = *inverse_kinematics(chain, wanted, branch, q);
    EXPECT_LT((same.q - q).norm(), 1e-8);
    for (int conf = 0; conf < 8; ++conf) {
      const InverseResult other = *inverse_kinematics(chain, wanted, conf, q);
      if (other.status == InverseStatus::kUnreachable) continue;
      EXPECT_LT(pose_difference(wanted, chain.flange_pose(other.q)).norm(), 1e-9)
          << "conf " << conf;
      EXPECT_EQ(std::sin(other.q(4)) < 0, (conf & 1) != 0);
      EXPECT_EQ(*branch_of(chain, other.q), conf);
      seen.insert(conf);
    }
  }
  EXPECT_EQ(seen.size(), 8u);
}

TEST(InverseKinematics, NumbersTheHomePostureAsTheControllerDoes) {
  JointVector home = JointVector::Zero(6);
  home(4) = from_deg(30);
  EXPECT_EQ(*branch_of(shipped("abb_irb6640-205-275.yaml"), home), 0);
  home(4) = from_deg(-30);
  EXPECT_EQ(*branch_of(shipped("abb_irb6640-205-275.yaml"), home), 1);
}

TEST(InverseKinematics, TellsOutOfReachFromOutsideTheLimits) {
  const Chain chain = shipped("abb_irb6640-205-275.yaml");
  Pose far = chain.flange_pose(JointVector::Zero(6));
  far.translation().x() += 3;
  EXPECT_EQ(inverse_kinematics(chain, far, JointVector::Zero(6)).status,
            InverseStatus::kUnreachable);
  EXPECT_EQ(inverse_kinematics(chain, far, 0)->status, InverseStatus::kUnreachable);
  JointVector beyond = JointVector::Zero(6);
  beyond(1) = from_deg(95);  // limit 85
  beyond(4) = from_deg(40);
  const Pose outside = chain.flange_pose(beyond);
  EXPECT_EQ(inverse_kinematics(chain, outside, beyond).status, InverseStatus::kJointLimit);
  EXPECT_EQ(inverse_kinematics(chain, outside, *branch_of(chain, beyond), beyond)->status,
            InverseStatus::kJointLimit);
}

TEST(InverseKinematics, CallsAStretchedWristSingular) {
  const Chain chain = shipped("abb_irb6640-205-275.yaml");
  const JointVector straight = JointVector::Zero(6);
  EXPECT_EQ(inverse_kinematics(chain, chain.flange_pose(straight), straight).status,
            InverseStatus::kSingular);
}

TEST(InverseKinematics, RefusesABranchWhereThereIsNone) {
  const Chain ur10 = shipped("universal-robots_ur10.yaml");
  EXPECT_FALSE(has_spherical_wrist(ur10));
  const auto refused = inverse_kinematics(ur10, ur10.flange_pose(JointVector::Ones(6)), 0);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refusal_of(refused), Refusal("", {}, "conf"));
  const Chain abb = shipped("abb_irb6640-205-275.yaml");
  EXPECT_FALSE(inverse_kinematics(abb, abb.flange_pose(JointVector::Ones(6) * 0.2), 8));
}

}  // namespace
}  // namespace trammel
