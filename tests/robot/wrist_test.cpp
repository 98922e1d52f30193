#include "server/robot/wrist.h"

#include <gtest/gtest.h>

#include <cmath>

#include "server/base/units.h"
#include "server/robot/cell.h"

namespace trammel {
namespace {

Chain shipped(const std::string& name) {
  const Result<Chain> chain =
      read_robot(std::string(TRAMMEL_SOURCE_DIR "/models/") + name + ".yaml");
  EXPECT_TRUE(chain) << name;
  return *chain;
}

const std::vector<std::string> kSixAxes = {"abb_irb6640-205-275",   "abb_irb120-3-06",
                                           "fanuc_m-20ia",          "kuka_kr210-r2700-extra",
                                           "staubli_tx2-90l",       "yaskawa_gp25",
                                           "universal-robots_ur10", "universal-robots_ur5",
                                           "abb_irb1200-5-09",      "abb_irb6640-205-275-on-rail"};

/// A pose with this wrist angle, away from other singularities.
JointVector opened(const Chain& chain, double angle) {
  JointVector q = JointVector::Constant(chain.size(), 0.3);
  q(chain.size() - 5) = -0.9;
  q(chain.size() - 4) = 1.2;
  const auto wrist = wrist_opening(chain, q, 2);
  if (!wrist) return q;
  q(chain.size() - 2) += (angle - wrist->angle) / wrist->by_joint(chain.size() - 2);
  return q;
}

TEST(Wrist, ItsIdleMotionLeavesTheFlangeWhereItIsOnEveryShippedArm) {
  for (const std::string& name : kSixAxes) {
    SCOPED_TRACE(name);
    const Chain chain = shipped(name);
    const auto wrist = wrist_opening(chain, opened(chain, 0), 1e-9);
    ASSERT_TRUE(wrist);
    EXPECT_NEAR(wrist->idle.norm(), 1, 1e-12);
    EXPECT_LT((chain.jacobian(opened(chain, 0)) * wrist->idle).norm(), 1e-9);
  }
}

TEST(Wrist, ItsAngleChangesWithTheJointsAsItSaysAndChangesSignAtTheSingularity) {
  for (const std::string& name : kSixAxes) {
    SCOPED_TRACE(name);
    const Chain chain = shipped(name);
    for (const double angle : {-0.05, 0.05}) {
      const JointVector q = opened(chain, angle);
      const auto wrist = wrist_opening(chain, q, 0.1);
      ASSERT_TRUE(wrist);
      EXPECT_NEAR(wrist->angle, angle, 1e-9);
      for (int j = 0; j < chain.size(); ++j) {
        JointVector moved = q;
        moved(j) += 1e-6;
        EXPECT_NEAR((wrist_opening(chain, moved, 0.1)->angle - angle) / 1e-6, wrist->by_joint(j),
                    1e-6)
            << j;
      }
    }
  }
}

TEST(Wrist, TurnedIdlyASphericalWristBringsTheFlangeToTheSamePlace) {
  const Chain chain = shipped("abb_irb6640-205-275");
  const JointVector q = opened(chain, 0);
  const JointVector turned = turned_idly(chain, q, *wrist_opening(chain, q, 1e-9), q(3) + 1.5);
  EXPECT_NEAR(turned(3), q(3) + 1.5, 1e-12);
  EXPECT_LT((chain.flange_pose(turned).matrix() - chain.flange_pose(q).matrix()).norm(), 1e-12);
}

TEST(Wrist, AnArmOfSevenTurningJointsAndAWideWristHaveNone) {
  const Chain seven = shipped("kuka_lbr-iiwa-7-r800");
  EXPECT_FALSE(wrist_opening(seven, JointVector::Zero(seven.size()), 2));
  const Chain chain = shipped("abb_irb6640-205-275");
  EXPECT_FALSE(wrist_opening(chain, opened(chain, 0.2), 0.1));
}

}  // namespace
}  // namespace trammel
