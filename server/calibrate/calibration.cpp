#include "server/calibrate/calibration.h"

#include <algorithm>
#include <cmath>

namespace trammel {

Eigen::MatrixXd CalibrationResult::correlation() const {
  const Eigen::VectorXd inverse = covariance.diagonal().cwiseSqrt().cwiseInverse();
  return inverse.asDiagonal() * covariance * inverse.asDiagonal();
}

double CalibrationResult::discrepancy_of_one(int together) const {
  return together > 1 ? std::max(discrepancy, std::sqrt(together) * discrepancy_of_pose)
                      : discrepancy;
}

}  // namespace trammel
