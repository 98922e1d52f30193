#include "server/compensate/evaluation.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "server/base/check.h"
#include "server/base/coverage.h"
#include "server/base/units.h"

namespace trammel {

namespace {

constexpr double kThreeSigma =
    0.997;  // share of a normal distribution within three standard deviations, as sources say

/// Between the two values that the place of `share` falls between; `sorted` rises.
double quantile(const Eigen::VectorXd& sorted, double share) {
  const auto n = sorted.size();
  const double place = share * static_cast<double>(n - 1);
  const auto below = static_cast<Eigen::Index>(place);
  const auto above = std::min(below + 1, n - 1);
  return sorted(below) + (place - static_cast<double>(below)) * (sorted(above) - sorted(below));
}

}  // namespace

double nlpd_in_mm(double nlpd_in_m) { return nlpd_in_m + std::log(to_mm(1.0)); }

ErrorFigures no_figures() {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  return {kNone, kNone, kNone, kNone, Vector3::Constant(kNone), Vector3::Constant(kNone)};
}

ErrorFigures figures_of(const Eigen::Matrix3Xd& e_B) {
  const auto n = e_B.cols();
  TRAMMEL_CHECK(n > 0);
  Eigen::VectorXd length = e_B.colwise().norm().transpose();
  std::sort(length.begin(), length.end());
  ErrorFigures figures;
  figures.rms = std::sqrt(length.squaredNorm() / static_cast<double>(n));
  figures.mean = length.mean();
  figures.p997 = quantile(length, kThreeSigma);
  figures.max = length(n - 1);
  figures.axis_mean = e_B.rowwise().mean();
  if (n > 1) {
    figures.axis_stddev =
        ((e_B.colwise() - figures.axis_mean).rowwise().squaredNorm() / static_cast<double>(n - 1))
            .cwiseSqrt();
  }
  return figures;
}

std::optional<double> negative_log_density(const Eigen::Matrix3Xd& error,
                                           const Eigen::Matrix3Xd& stddev) {
  const auto z = error.array() / stddev.array();
  const double mean =
      (0.5 * z.square() + stddev.array().log()).mean() + 0.5 * std::log(2 * std::numbers::pi);
  return std::isfinite(mean) ? std::optional(mean) : std::nullopt;
}

double coverage_95(const Eigen::MatrixXd& error, const Eigen::MatrixXd& stddev) {
  return (error.array().abs() <= kInterval95 * stddev.array()).cast<double>().mean();
}

}  // namespace trammel
