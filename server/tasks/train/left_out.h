#pragma once

#include <optional>
#include <vector>

#include "server/calibrate/calibrate.h"

namespace trammel {

/// The result that identification would have had of a batch without some of its poses: to first
/// order about what it found with all, by a downdate of the covariance, so without another search.
/// Where the covariance is 0 nothing moves. Suspects and gauges are no observations here.
/// Immutable, thread-safe.
class LeftOut {
 public:
  LeftOut(const CalibrationResult& found, const MeasurementBatch& batch);

  [[nodiscard]] Eigen::Index size() const { return q_.rows(); }
  [[nodiscard]] const Eigen::MatrixXd& q() const {
    return q_;
  }  ///< N x n, rad: the observations, as in the batch

  struct Without {
    Eigen::MatrixXd residual_B;  ///< N x 3, m: of all observations
    Eigen::VectorXd variance;    ///< of each one left out, m², mean of its coordinates: what the
                                 ///< parameters make of it
  };
  /// Without these observations; empty where too little is left to identify from.
  [[nodiscard]] std::optional<Without> without(const std::vector<Eigen::Index>& poses) const;

 private:
  // Residuals and derivatives in units of their standard deviations, six rows a pose, zero where it
  // has no orientation; the parameters in directions in which they are independent with unit
  // variance.
  Eigen::MatrixXd q_;
  Eigen::VectorXd residual_;  // 6 N
  Eigen::MatrixXd J_;         // 6 N x P
  Eigen::VectorXd sigma_;     // N, m, of one coordinate of the position
  Matrix3 R_BW_;
};

}  // namespace trammel
