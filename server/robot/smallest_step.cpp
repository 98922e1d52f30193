#include "server/robot/smallest_step.h"

#include <algorithm>
#include <cmath>

namespace trammel {

double ArmSteps::smallest(const Chain& robot, const JointVector& q, const Vector3& p_F) const {
  const bool told =
      std::any_of(encoders.begin(), encoders.end(), [](double step) { return step > 0; });
  if (!told) return repeatability;
  const Eigen::MatrixXd J_B = robot.jacobian(q, p_F).topRows<3>();
  double variance = 0;
  for (int j = 0; j < robot.size(); ++j) {
    const double step = encoders[static_cast<std::size_t>(j)];
    variance += step * step / 12 * J_B.col(j).squaredNorm();
  }
  return std::max(repeatability, kRadiusOfRms * std::sqrt(variance));
}

}  // namespace trammel
