#include "server/exchange/si.h"

#include "server/base/units.h"

namespace trammel::exchange {

Pose from_si(const trammel::Pose& X_AB) {
  const Eigen::Quaterniond R(X_AB.linear());
  return {mm_from_si(X_AB.translation()), {R.w(), R.x(), R.y(), R.z()}};
}

trammel::Pose to_si(const Pose& X_AB) {
  const auto& [p, q] = X_AB;
  return make_pose(Eigen::Quaterniond(q[0], q[1], q[2], q[3]).normalized().toRotationMatrix(),
                   Vector3(p[0], p[1], p[2]) * from_mm(1));
}

std::array<double, 3> mm_from_si(const Vector3& v) {
  return {to_mm(v.x()), to_mm(v.y()), to_mm(v.z())};
}

std::array<double, 3> deg_from_si(const Vector3& v) {
  return {to_deg(v.x()), to_deg(v.y()), to_deg(v.z())};
}

Rails rails_of(const std::vector<JointType>& types) {
  Rails rails;
  for (const JointType type : types) rails.push_back(type == JointType::kPrismatic);
  return rails;
}

Rails rails_of(const Chain& robot) {
  Rails rails;
  for (int j = 0; j < robot.size(); ++j)
    rails.push_back(robot.joint(j).type == JointType::kPrismatic);
  return rails;
}

std::vector<double> degrees_from_si(const JointVector& q, const Rails& rails) {
  std::vector<double> joints;
  for (const double value : q)
    joints.push_back(is_rail(rails, joints.size()) ? to_mm(value) : to_deg(value));
  return joints;
}

JointVector si_from_degrees(const std::vector<double>& joints_deg, const Chain& robot) {
  JointVector q(robot.size());
  for (int j = 0; j < robot.size(); ++j) {
    const double value = joints_deg[static_cast<std::size_t>(j)];
    q(j) = robot.joint(j).type == JointType::kPrismatic ? from_mm(value) : from_deg(value);
  }
  return q;
}

std::vector<double> asked_from_si(const JointVector& q, const Rails& rails) {
  std::vector<double> joints;
  for (const double value : q)
    joints.push_back(is_rail(rails, joints.size()) ? to_mm(value) : value);
  return joints;
}

JointVector si_from_asked(const std::vector<double>& q_rad, const Chain& robot) {
  JointVector q(robot.size());
  for (int j = 0; j < robot.size(); ++j) {
    const double value = q_rad[static_cast<std::size_t>(j)];
    q(j) = robot.joint(j).type == JointType::kPrismatic ? from_mm(value) : value;
  }
  return q;
}

}  // namespace trammel::exchange
