#include "server/diagnose/evidence/validation.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "server/diagnose/evidence/background.h"
#include "server/diagnose/thresholds.h"

namespace trammel::cause_search {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kFarthest = 400;    // of chi-square: beyond it the chance is 0 in double precision
constexpr int kChanceHalvings = 60;  // of an interval: the full precision of a double

/// The quantile of chi-square with three degrees of freedom that is exceeded with that chance.
double chi_square_3(double chance) {
  const auto beyond = [](double x) {
    return std::erfc(std::sqrt(x / 2)) + std::sqrt(2 * x / std::numbers::pi) * std::exp(-x / 2);
  };
  double low = 0;
  double high = kFarthest;
  for (int k = 0; k < kChanceHalvings; ++k) {
    const double middle = 0.5 * (low + high);
    (beyond(middle) > chance ? low : high) = middle;
  }
  return high;
}

/// The distance from a model of rows that nothing was learned from.
struct Judged {
  Eigen::Matrix3Xd error_B;  ///< m
  VectorXd distance;  ///< squared error over the expected one: chi-square of three if the row fits
};

Judged judged(const LinearProblem& fitted, const MeasurementBatch& rows) {
  const PhysicalModel& model = fitted.model();
  const MatrixXd covariance = Background(fitted.nuisance()).covariance();
  const VectorXd scale = scales_of(fitted.nuisance_parameters());
  const auto n = static_cast<Index>(rows.measurements.size());
  Judged result{Eigen::Matrix3Xd(3, n), VectorXd(n)};
  MatrixXd J;
  for (Index i = 0; i < n; ++i) {
    const Measurement& m = rows.measurements[static_cast<std::size_t>(i)];
    const Vector3 error = m.p_W - model.pose_W(m.context, model.values, &J).translation();
    const MatrixXd scaled = J.topRows<3>() * scale.asDiagonal();
    const double sigma = std::max(fitted.noise(), m.sigma.value_or(0));
    const Matrix3 expected =
        scaled * covariance * scaled.transpose() + sigma * sigma * Matrix3::Identity();
    result.error_B.col(i) = model.X_WB.linear().transpose() * error;
    result.distance(i) = error.dot(expected.llt().solve(error));
  }
  return result;
}

}  // namespace

Validation validate(const LinearProblem& before, const LinearProblem& after,
                    const MeasurementBatch& rows) {
  const Judged first = judged(before, rows);
  const Judged last = judged(after, rows);
  const double limit =
      chi_square_3(thresholds::kMisjudgedHeldOut / static_cast<double>(rows.measurements.size()));
  Validation validation{figures_of(first.error_B), figures_of(last.error_B), {}, {}, {}};
  std::vector<Index> fit;
  for (Index i = 0; i < first.distance.size(); ++i) {
    if (std::min(first.distance(i), last.distance(i)) <= limit) {
      fit.push_back(i);
      continue;
    }
    const Measurement& m = rows.measurements[static_cast<std::size_t>(i)];
    validation.fit_neither.push_back({.pose_id = m.pose_id,
                                      .row = m.row,
                                      .distance = last.error_B.col(i).norm(),
                                      .reason = "held-out pose that fits neither model: repeat it",
                                      .held_out = true});
  }
  if (!validation.fit_neither.empty() && !fit.empty()) {
    validation.before_without = figures_of(first.error_B(Eigen::all, fit));
    validation.after_without = figures_of(last.error_B(Eigen::all, fit));
  }
  return validation;
}

}  // namespace trammel::cause_search
