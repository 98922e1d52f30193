#pragma once

#include <optional>
#include <vector>

#include "server/calibrate/calibrate.h"

namespace trammel {

/// The result of identification without some of the batch's poses, to first order about the result
/// with all. It comes from a downdate of the covariance, so there is no new search. A parameter
/// with covariance 0 does not move. Suspects and gauges are no observations here. Immutable,
/// thread-safe.
class LeftOut {
 public:
  LeftOut(const CalibrationResult& found, const MeasurementBatch& batch);

  [[nodiscard]] Eigen::Index size() const { return q_.rows(); }
  [[nodiscard]] const Eigen::MatrixXd& q() const {
    return q_;
  }  ///< N x n, rad: the observations, as in the batch

  struct Without {
    Eigen::MatrixXd residual_B;  ///< N x 3, m: of all observations
    Eigen::VectorXd variance;  ///< of each left-out pose, m², mean of its coordinates: the variance
                               ///< from the parameters
  };
  /// The result without these observations; empty if too little is left to identify from.
  [[nodiscard]] std::optional<Without> without(const std::vector<Eigen::Index>& poses) const;

 private:
  // Residuals and derivatives in units of their standard deviations, six rows per pose, zero
  // without an orientation. The parameters are expressed in independent directions with unit
  // variance.
  Eigen::MatrixXd q_;
  Eigen::VectorXd residual_;  // 6 N
  Eigen::MatrixXd J_;         // 6 N x P
  Eigen::VectorXd sigma_;     // N, m, of one coordinate of the position
  Matrix3 R_BW_;
};

}  // namespace trammel
