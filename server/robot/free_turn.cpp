#include "server/robot/free_turn.h"

#include "server/base/units.h"
#include "server/robot/passive_joint.h"
#include "server/robot/wrist.h"

namespace trammel {

namespace {

constexpr double kFromLimit = from_deg(5);
constexpr double kFromLimitOfRail = from_mm(50);
constexpr double kFromWrist = from_deg(10);

}  // namespace

Pose turned_freely(const Pose& X_BT, int steps) {
  Pose turned = X_BT;
  turned.rotate(Eigen::AngleAxisd(steps * kFreeTurn, Vector3::UnitZ()));
  return turned;
}

bool stands_clear(const Chain& robot, const JointVector& q) {
  for (int j = 0; j < robot.size(); ++j) {
    const Joint& joint = robot.joint(j);
    if (is_passive(joint)) continue;
    const double room = joint.type == JointType::kRevolute ? kFromLimit : kFromLimitOfRail;
    if (q(j) < joint.lower + room || q(j) > joint.upper - room) return false;
  }
  return !wrist_opening(robot, q, kFromWrist);
}

}  // namespace trammel
