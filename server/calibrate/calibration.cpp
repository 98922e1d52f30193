#include "server/calibrate/calibration.h"

namespace trammel {

Eigen::MatrixXd CalibrationResult::correlation() const {
  const Eigen::VectorXd inverse = covariance.diagonal().cwiseSqrt().cwiseInverse();
  return inverse.asDiagonal() * covariance * inverse.asDiagonal();
}

}  // namespace trammel
