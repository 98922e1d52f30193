#include "server/robot/arm_shape.h"

namespace trammel {

namespace {
constexpr double kShortest = 1e-6;  // m
}

std::vector<ArmPart> arm_parts(const Chain& robot, const JointVector& q,
                               const std::optional<Vector3>& tool_F) {
  std::vector<ArmPart> parts;
  Pose X = Pose::Identity();
  const auto go = [&](const Vector3& along, int link) {
    if (along.norm() < kShortest) return;
    const Vector3 from = X.translation();
    X.translate(along);
    parts.push_back({from, X.translation(), link});
  };
  int link = 0;
  for (const LinkGeometry& one : robot.links_at(q)) {
    X.rotate(Eigen::AngleAxisd(one.theta, Vector3::UnitZ()));
    go(one.d * Vector3::UnitZ(), link);
    go(one.a * Vector3::UnitX(), link);
    X.rotate(Eigen::AngleAxisd(one.alpha, Vector3::UnitX()))
        .rotate(Eigen::AngleAxisd(one.beta, Vector3::UnitY()));
    ++link;
  }
  if (tool_F) go(*tool_F, link);
  return parts;
}

}  // namespace trammel
