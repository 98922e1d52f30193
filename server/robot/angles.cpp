#include "server/robot/angles.h"

#include <cmath>

#include "server/base/units.h"

namespace trammel {

namespace {

double nearest_turn(const Joint& joint, double angle, double near) {
  const double nearest = angle + 2 * kPi * std::round((near - angle) / (2 * kPi));
  for (const double turns : {0.0, 1.0, -1.0, 2.0, -2.0}) {
    const double candidate = nearest + 2 * kPi * turns;
    if (candidate >= joint.lower - 1e-9 && candidate <= joint.upper + 1e-9) return candidate;
  }
  return nearest;
}

}  // namespace

JointVector joints_of_angles(const Chain& chain, const std::array<double, 6>& theta,
                             const std::optional<JointVector>& near) {
  Vector6 value;
  for (int i = 0; i < 6; ++i)
    value(i) = theta[static_cast<std::size_t>(i)] - chain.joint(i).link.theta;
  JointVector q = Eigen::Matrix<double, 6, 6>(chain.transmission()).partialPivLu().solve(value);
  for (int i = 0; i < 6; ++i) q(i) = nearest_turn(chain.joint(i), q(i), near ? (*near)(i) : 0.0);
  return q;
}

}  // namespace trammel
