#include "server/calibrate/identify/weighting.h"

#include <algorithm>
#include <cmath>

#include "server/base/units.h"

namespace trammel {

namespace {

constexpr double kSuspect = 5.5;        // norm of 3 axes that 1 in 10^6 good poses exceeds
constexpr double kSettledSigma = 2e-3;  // relative: a sigma that changes by less weighs the same
constexpr int kBisections = 100;        // more than a double has bits

/// The surplus s with sum r^2 / (sigma_i^2 + s^2) = freedom (Paule and Mandel's between-laboratory variance); 0 where
/// the residuals are no larger than their sigmas.
double surplus(const Eigen::Matrix3Xd& r, const Eigen::VectorXd& sigma, double freedom) {
  const auto chi2 = [&](double s) {
    double sum = 0;
    for (Eigen::Index i = 0; i < r.cols(); ++i) sum += r.col(i).squaredNorm() / (sigma(i) * sigma(i) + s * s);
    return sum;
  };
  if (r.cols() == 0 || freedom <= 0 || chi2(0) <= freedom) return 0;
  double low = 0;
  double high = std::sqrt(r.squaredNorm() / freedom) + 1e-15;
  for (int k = 0; k < kBisections; ++k) {
    const double middle = 0.5 * (low + high);
    (chi2(middle) > freedom ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

double sigmas_of(const Residuals& r, Eigen::Index i, const Weights& weights) {
  return r.position.col(i).norm() / std::hypot(r.sigma(i), weights.discrepancy);
}

/// The positions that are no suspects; rotations stay.
Residuals without_suspects(const Residuals& r, const Weights& weights) {
  Residuals kept{r.position, r.rotation, r.sigma, r.sigma_rotation};
  Eigen::Index count = 0;
  for (Eigen::Index i = 0; i < r.position.cols(); ++i) {
    if (sigmas_of(r, i, weights) > kSuspect) continue;
    kept.position.col(count) = r.position.col(i);
    kept.sigma(count++) = r.sigma(i);
  }
  kept.position.conservativeResize(3, count);
  kept.sigma.conservativeResize(count);
  return kept;
}

}  // namespace

double position_sigma(const Measurement& m, const Cell& cell) { return m.sigma.value_or(cell.tracker.sigma); }

double rotation_sigma(const Measurement& m, const Cell& cell) {
  return m.sigma_rotation.value_or(cell.tracker.sigma_rotation);
}

Residuals residuals_of(const PhysicalModel& model, const MeasurementBatch& batch, const Eigen::VectorXd& values) {
  const auto n = static_cast<Eigen::Index>(batch.measurements.size());
  Residuals r{Eigen::Matrix3Xd(3, n), Eigen::Matrix3Xd(3, n), Eigen::VectorXd(n), Eigen::VectorXd(n)};
  Eigen::Index turned = 0;
  for (Eigen::Index i = 0; i < n; ++i) {
    const Measurement& m = batch.measurements[static_cast<std::size_t>(i)];
    const Pose X_WT = model.pose_W(m.context, values, nullptr);
    r.position.col(i) = m.p_W - X_WT.translation();
    r.sigma(i) = position_sigma(m, *model.cell);
    if (!m.R_WT) continue;
    r.sigma_rotation(turned) = rotation_sigma(m, *model.cell);
    r.rotation.col(turned++) = rotation_log(*m.R_WT * X_WT.linear().transpose());
  }
  r.rotation.conservativeResize(3, turned);
  r.sigma_rotation.conservativeResize(turned);
  return r;
}

Weights estimated_weights(const Residuals& r, double freedom, const Weights& before, bool drop_suspects) {
  const double positions = 3.0 * static_cast<double>(r.position.cols());
  const double rotations = 3.0 * static_cast<double>(r.rotation.cols());
  const double share = std::max(0.0, 1 - freedom / (positions + rotations));
  const Residuals trusted = drop_suspects ? without_suspects(r, before) : r;
  return {surplus(trusted.position, trusted.sigma, 3.0 * static_cast<double>(trusted.position.cols()) * share),
          surplus(r.rotation, r.sigma_rotation, rotations * share), true};
}

bool are_settled(const Weights& now, const Weights& before, const Tracker& tracker) {
  const auto settled = [](double sigma, double a, double b) {
    return std::abs(std::hypot(sigma, a) - std::hypot(sigma, b)) <= kSettledSigma * std::hypot(sigma, a);
  };
  return before.estimated && settled(tracker.sigma, now.discrepancy, before.discrepancy) &&
         settled(tracker.sigma_rotation, now.discrepancy_rotation, before.discrepancy_rotation);
}

std::vector<SuspectPose> suspects_of(const MeasurementBatch& batch, const Residuals& r, const Weights& weights) {
  std::vector<SuspectPose> suspects;
  for (Eigen::Index i = 0; i < r.position.cols(); ++i) {
    const double sigmas = sigmas_of(r, i, weights);
    const Measurement& m = batch.measurements[static_cast<std::size_t>(i)];
    if (sigmas > kSuspect) suspects.push_back({m.pose_id, m.row, r.position.col(i).norm(), sigmas});
  }
  std::sort(suspects.begin(), suspects.end(), [](const auto& a, const auto& b) { return a.sigmas > b.sigmas; });
  return suspects;
}

double log_likelihood(const Residuals& r, const Weights& weights) {
  double sum = 0;
  const auto add = [&](const auto& residual, double sigma, double discrepancy) {
    const double variance = sigma * sigma + discrepancy * discrepancy;
    const double square = std::min(residual.squaredNorm() / variance, kSuspect * kSuspect);
    sum -= 0.5 * square + 1.5 * std::log(2 * kPi * variance);
  };
  for (Eigen::Index i = 0; i < r.position.cols(); ++i) add(r.position.col(i), r.sigma(i), weights.discrepancy);
  for (Eigen::Index i = 0; i < r.rotation.cols(); ++i) {
    add(r.rotation.col(i), r.sigma_rotation(i), weights.discrepancy_rotation);
  }
  return sum;
}

}  // namespace trammel
