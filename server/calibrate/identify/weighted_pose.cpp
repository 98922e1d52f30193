#include "server/calibrate/identify/weighted_pose.h"

#include <cmath>

#include "server/error_sources/anchors.h"

namespace trammel {

namespace {

// Norms that 1 in 1000 good poses exceeds: roots of quantiles of chi-squared.
constexpr double kHuberGauge = 3.29;     // 1 axis
constexpr double kHuberPosition = 4.03;  // 3 axes
constexpr double kHuberPose = 4.74;      // 6 axes
constexpr double kSmallAngle =
    1e-4;  // rad: below it the closed form loses digits, and its limit is exact enough

Matrix3 right_jacobian_inverse(const Vector3& w) {
  const double angle = w.norm();
  const Matrix3 W = skew(w);
  const double c = angle < kSmallAngle ? 1.0 / 12
                                       : 1 / (angle * angle) -
                                             (1 + std::cos(angle)) / (2 * angle * std::sin(angle));
  return Matrix3::Identity() + 0.5 * W + c * W * W;
}

}  // namespace

WeightedPose::WeightedPose(const PhysicalModel& model, const ScaledParameters& s,
                           const Measurement& measurement, const Weights& weights, std::size_t row)
    : model_(model),
      s_(s),
      measurement_(measurement),
      inverse_sigma_(1 / std::hypot(position_sigma(measurement, *model.cell),
                                    weights.beside(measurement, row))),
      inverse_rotation_sigma_(
          1 / std::hypot(rotation_sigma(measurement, *model.cell), weights.discrepancy_rotation)) {}

bool WeightedPose::evaluate_gauge(const Eigen::VectorXd& values, double* residuals,
                                  double* jacobian) const {
  const Eigen::Index F = s_.scale.size();
  Eigen::MatrixXd J;
  const Eigen::VectorXd told = predicted_gauge(model_, measurement_.context, *measurement_.gauge,
                                               values, jacobian != nullptr ? &J : nullptr);
  Eigen::Map<Eigen::VectorXd>(residuals, size()) =
      inverse_sigma_ * (measurement_.gauge->value - told.array()).matrix();
  if (jacobian != nullptr) {
    Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>> out(
        jacobian, size(), F);
    for (Eigen::Index k = 0; k < F; ++k)
      out.col(k) = -inverse_sigma_ * s_.scale(k) * J.col(s_.free[static_cast<std::size_t>(k)]);
  }
  return told.allFinite();
}

bool WeightedPose::evaluate(const double* x, double* residuals, double* jacobian) const {
  const Eigen::Index F = s_.scale.size();
  const Eigen::VectorXd values = s_.values_at(Eigen::Map<const Eigen::VectorXd>(x, F));
  if (measurement_.gauge) return evaluate_gauge(values, residuals, jacobian);
  Eigen::MatrixXd J;
  const Pose X_WT = model_.pose_W(measurement_.context, values, jacobian != nullptr ? &J : nullptr);
  Eigen::Map<Eigen::VectorXd> r(residuals, size());
  r.head<3>() = inverse_sigma_ * (measurement_.p_W - X_WT.translation());
  Vector3 turn = Vector3::Zero();
  if (measurement_.R_WT) {
    turn = rotation_log(*measurement_.R_WT * X_WT.linear().transpose());
    r.tail<3>() = inverse_rotation_sigma_ * turn;
  }
  if (jacobian != nullptr) {
    Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>> out(
        jacobian, size(), F);
    // d log(R_m (exp(w) R)ᵀ) = -Jr^-1(turn) w to first order in w, Jr the right Jacobian of SO(3).
    const Matrix3 by_turn = -inverse_rotation_sigma_ * right_jacobian_inverse(turn);
    for (Eigen::Index k = 0; k < F; ++k) {
      const auto column = J.col(s_.free[static_cast<std::size_t>(k)]);
      out.col(k).head<3>() = -inverse_sigma_ * s_.scale(k) * column.head<3>();
      if (measurement_.R_WT) out.col(k).tail<3>() = s_.scale(k) * (by_turn * column.tail<3>());
    }
  }
  return X_WT.translation().allFinite();
}

double WeightedPose::huber_limit() const {
  return size() == 1 ? kHuberGauge : size() == 3 ? kHuberPosition : kHuberPose;
}

}  // namespace trammel
