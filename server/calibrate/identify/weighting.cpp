#include "server/calibrate/identify/weighting.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

#include "server/base/units.h"
#include "server/error_sources/anchors.h"
#include "server/measurement/pose_groups.h"

namespace trammel {

namespace {

constexpr double kSuspect = 5.5;        // norm of 3 axes that 1 in 10^6 good poses exceeds
constexpr double kSuspectGauge = 4.89;  // the same of 1 axis
constexpr double kSettledSigma = 2e-3;  // relative: a smaller change of a sigma does not change the
                                        // weights
constexpr int kBisections = 100;        // more than a double has bits
constexpr double kLeastOwn = 0.25;  // share of the stated variance that no other position shares,
                                    // at least
constexpr double kLeastShare =
    0.05;  // share of the equations that no parameter is counted against, at least

/// Squared residuals with their number of axes, their variances, and how often the model's own
/// variance enters them.
struct WeightedSquares {
  std::vector<double> square, variance, times;
  double axes = 0;

  void add(double squared, double sigma, double often, int of_axes) {
    square.push_back(squared);
    variance.push_back(sigma * sigma);
    times.push_back(often);
    axes += of_axes;
  }
};

/// The surplus s with sum r^2 / (sigma_i^2 + s^2) = freedom (Paule and Mandel's between-laboratory
/// variance); 0 where the residuals are no larger than their sigmas.
double surplus(const WeightedSquares& r, double freedom) {
  const auto chi2 = [&](double s) {
    double sum = 0;
    for (std::size_t i = 0; i < r.square.size(); ++i)
      sum += r.square[i] / (r.variance[i] + r.times[i] * s * s);
    return sum;
  };
  if (r.square.empty() || freedom <= 0 || chi2(0) <= freedom) return 0;
  double low = 0;
  double high = std::sqrt(std::accumulate(r.square.begin(), r.square.end(), 0.0) / freedom) + 1e-15;
  for (int k = 0; k < kBisections; ++k) {
    const double middle = 0.5 * (low + high);
    (chi2(middle) > freedom ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

double sigmas_of(const Residuals& r, Eigen::Index i, const Weights& weights) {
  return r.position.col(i).norm() / std::hypot(r.sigma(i), weights.discrepancy);
}

double variance_of_gauge(const Residuals& r, Eigen::Index i, const Weights& weights) {
  return std::pow(r.sigma_gauge(i), 2) + r.poses_of_gauge(i) * std::pow(weights.discrepancy, 2);
}

double sigmas_of_gauge(const Residuals& r, Eigen::Index i, const Weights& weights) {
  return std::abs(r.gauge(i)) / std::sqrt(variance_of_gauge(r, i, weights));
}

/// Squared lengths of positions and gauges, since the model error is equal in all directions. With
/// `weights`, suspects under them are left out.
WeightedSquares lengths_of(const Residuals& r, const std::optional<Weights>& weights) {
  WeightedSquares lengths;
  for (Eigen::Index i = 0; i < r.position.cols(); ++i) {
    if (weights && sigmas_of(r, i, *weights) > kSuspect) continue;
    lengths.add(r.position.col(i).squaredNorm(), r.sigma(i), 1, 3);
  }
  for (Eigen::Index i = 0; i < r.gauge.size(); ++i) {
    if (weights && sigmas_of_gauge(r, i, *weights) > kSuspectGauge) continue;
    lengths.add(r.gauge(i) * r.gauge(i), r.sigma_gauge(i), r.poses_of_gauge(i), 1);
  }
  return lengths;
}

WeightedSquares turns_of(const Residuals& r) {
  WeightedSquares turns;
  for (Eigen::Index i = 0; i < r.rotation.cols(); ++i)
    turns.add(r.rotation.col(i).squaredNorm(), r.sigma_rotation(i), 1, 3);
  return turns;
}

/// Positions at one joint vector: their mean, and their deviations from it.
struct SeenTogether {
  Vector3 mean = Vector3::Zero();
  double variance = 0;  // m², the stated variance of one of them
  double apart = 0;     // m², sum of squares about the mean
  double count = 0;
};

SeenTogether seen_together(const Residuals& r, const std::vector<Eigen::Index>& columns) {
  SeenTogether seen;
  seen.count = static_cast<double>(columns.size());
  for (const Eigen::Index i : columns) {
    seen.mean += r.position.col(i) / seen.count;
    seen.variance += r.sigma(i) * r.sigma(i) / seen.count;
  }
  for (const Eigen::Index i : columns) seen.apart += (r.position.col(i) - seen.mean).squaredNorm();
  return seen;
}

/// m per axis: the error of the means of positions at one joint vector beyond their sigmas, at most
/// `discrepancy`. 0 if no joint vector has several positions.
double shared_by_poses(const Residuals& r, const Freedom& freedom, double discrepancy,
                       const Weights& before, bool drop_suspects) {
  if (r.together.empty()) return 0;
  WeightedSquares means;
  double most = std::pow(discrepancy, 2);
  for (const std::vector<Eigen::Index>& columns : r.together) {
    const SeenTogether seen = seen_together(r, columns);
    const double sigma = std::sqrt(seen.variance / seen.count);
    most += seen.variance * (1 - 1 / seen.count) / static_cast<double>(r.together.size());
    if (drop_suspects && seen.mean.norm() > kSuspect * std::hypot(sigma, before.of_pose)) continue;
    means.add(seen.mean.squaredNorm(), sigma, 1, 3);
  }
  const double axes = 3.0 * static_cast<double>(r.together.size());
  return std::min(std::sqrt(most),
                  surplus(means, means.axes * std::max(kLeastShare, 1 - freedom.means / axes)));
}

/// Nat, for positions that share an error at one joint vector (compound symmetry): the log
/// likelihood of their mean and of their deviations from it.
double log_likelihood_together(const Residuals& r, const std::vector<Eigen::Index>& columns,
                               const Weights& weights) {
  const SeenTogether seen = seen_together(r, columns);
  const double all = seen.variance + std::pow(weights.discrepancy, 2);
  const double own = std::max(kLeastOwn * seen.variance, all - std::pow(weights.of_pose, 2));
  const double of_sum = own + seen.count * std::pow(weights.of_pose, 2);
  const double limit = kSuspect * kSuspect;
  const double square = std::min(seen.count * seen.mean.squaredNorm() / of_sum, limit) +
                        std::min(seen.apart / own, (seen.count - 1) * limit);
  return -0.5 * square -
         1.5 * (std::log(2 * kPi * of_sum) + (seen.count - 1) * std::log(2 * kPi * own));
}

/// The share of `axes` that no parameter was fitted to.
double share_left(double freedom, double axes) {
  return axes > 0 ? std::max(0.0, 1 - freedom / axes) : 0;
}

}  // namespace

double position_sigma(const Measurement& m, const Cell& cell) {
  return m.sigma.value_or(cell.tracker.sigma);
}

double rotation_sigma(const Measurement& m, const Cell& cell) {
  return m.sigma_rotation.value_or(cell.tracker.sigma_rotation);
}

double Weights::beside_alone(const Measurement& m) const {
  return std::sqrt(gauged_poses(m)) * discrepancy;
}

double Weights::beside(const Measurement& m, std::size_t row) const {
  const double alone = beside_alone(m);
  const int count = row < together.size() ? together[row] : 1;
  return count > 1 ? std::max(alone, std::sqrt(count) * of_pose) : alone;
}

Weights weights_of(const CalibrationResult& found, const MeasurementBatch& batch) {
  return {found.discrepancy, found.discrepancy_rotation, true, found.discrepancy_of_pose,
          counted_together(batch)};
}

std::vector<std::vector<Eigen::Index>> columns_together(const MeasurementBatch& batch,
                                                        const Residuals& r) {
  std::vector<Eigen::Index> column_of(batch.measurements.size(), -1);
  for (Eigen::Index column = 0; column < r.position.cols(); ++column)
    column_of[static_cast<std::size_t>(r.positions[static_cast<std::size_t>(column)])] = column;
  std::vector<std::vector<Eigen::Index>> together;
  for (PoseGroup& rows : groups_seen_together(batch)) {
    for (Eigen::Index& row : rows) row = column_of[static_cast<std::size_t>(row)];
    if (rows.front() >= 0) together.push_back(std::move(rows));
  }
  return together;
}

double gauged_poses(const Measurement& m) { return m.gauge && m.gauge->minus != nullptr ? 2 : 1; }

double Residuals::rms() const {
  if (position.cols() > 0)
    return std::sqrt(position.squaredNorm() / static_cast<double>(position.cols()));
  return gauge.size() == 0 ? 0 : std::sqrt(gauge.squaredNorm() / static_cast<double>(gauge.size()));
}

Residuals residuals_of(const PhysicalModel& model, const MeasurementBatch& batch,
                       const Eigen::VectorXd& values) {
  const auto n = static_cast<Eigen::Index>(batch.measurements.size());
  Residuals r{Eigen::Matrix3Xd(3, n),
              Eigen::Matrix3Xd(3, n),
              Eigen::VectorXd(n),
              Eigen::VectorXd(n),
              {},
              {},
              Eigen::VectorXd(n),
              Eigen::VectorXd(n),
              Eigen::VectorXd(n),
              {}};
  Eigen::Index turned = 0, placed = 0, gauged = 0;
  for (Eigen::Index i = 0; i < n; ++i) {
    const Measurement& m = batch.measurements[static_cast<std::size_t>(i)];
    if (m.gauge && m.gauge->kind == Gauge::Kind::kContact) {
      r.positions.push_back(i);
      r.sigma(placed) = position_sigma(m, *model.cell);
      r.position.col(placed++) = -predicted_gauge(model, m.context, *m.gauge, values);
      continue;
    }
    if (m.gauge) {
      r.gauges.push_back(i);
      r.sigma_gauge(gauged) = position_sigma(m, *model.cell);
      r.poses_of_gauge(gauged) = gauged_poses(m);
      r.gauge(gauged++) = m.gauge->value - predicted_gauge(model, m.context, *m.gauge, values)(0);
      continue;
    }
    const Pose X_WT = model.pose_W(m.context, values, nullptr);
    r.positions.push_back(i);
    r.sigma(placed) = position_sigma(m, *model.cell);
    r.position.col(placed++) = m.p_W - X_WT.translation();
    if (!m.R_WT) continue;
    r.sigma_rotation(turned) = rotation_sigma(m, *model.cell);
    r.rotation.col(turned++) = rotation_log(*m.R_WT * X_WT.linear().transpose());
  }
  r.position.conservativeResize(3, placed);
  r.sigma.conservativeResize(placed);
  r.rotation.conservativeResize(3, turned);
  r.sigma_rotation.conservativeResize(turned);
  r.gauge.conservativeResize(gauged);
  r.sigma_gauge.conservativeResize(gauged);
  r.poses_of_gauge.conservativeResize(gauged);
  return r;
}

Weights estimated_weights(const Residuals& r, const Freedom& freedom, const Weights& before,
                          bool drop_suspects) {
  const WeightedSquares turns = turns_of(r);
  const double lengths =
      3.0 * static_cast<double>(r.position.cols()) + static_cast<double>(r.gauge.size());
  const WeightedSquares trusted =
      lengths_of(r, drop_suspects ? std::optional(before) : std::nullopt);
  const double discrepancy =
      surplus(trusted, trusted.axes * share_left(freedom.positions, lengths));
  return {discrepancy, surplus(turns, turns.axes * share_left(freedom.turns, turns.axes)), true,
          shared_by_poses(r, freedom, discrepancy, before, drop_suspects), before.together};
}

bool are_settled(const Weights& now, const Weights& before, const Tracker& tracker) {
  const auto settled = [](double sigma, double a, double b) {
    return std::abs(std::hypot(sigma, a) - std::hypot(sigma, b)) <=
           kSettledSigma * std::hypot(sigma, a);
  };
  return before.estimated && settled(tracker.sigma, now.discrepancy, before.discrepancy) &&
         settled(tracker.sigma, now.of_pose, before.of_pose) &&
         settled(tracker.sigma_rotation, now.discrepancy_rotation, before.discrepancy_rotation);
}

Eigen::VectorXd farness_of(const MeasurementBatch& batch, const Residuals& r,
                           const Weights& weights) {
  Eigen::VectorXd farness(static_cast<Eigen::Index>(batch.measurements.size()));
  for (Eigen::Index i = 0; i < r.position.cols(); ++i)
    farness(r.positions[static_cast<std::size_t>(i)]) = sigmas_of(r, i, weights) / kSuspect;
  for (Eigen::Index i = 0; i < r.gauge.size(); ++i)
    farness(r.gauges[static_cast<std::size_t>(i)]) = sigmas_of_gauge(r, i, weights) / kSuspectGauge;
  return farness;
}

std::vector<SuspectPose> off_by(const MeasurementBatch& batch, const Residuals& r,
                                const Weights& weights) {
  std::vector<SuspectPose> all;
  const auto add = [&](Eigen::Index measurement, double distance, double sigmas) {
    const Measurement& m = batch.measurements[static_cast<std::size_t>(measurement)];
    all.push_back({m.pose_id, m.row, distance, sigmas});
  };
  for (Eigen::Index i = 0; i < r.position.cols(); ++i)
    add(r.positions[static_cast<std::size_t>(i)], r.position.col(i).norm(),
        sigmas_of(r, i, weights));
  for (Eigen::Index i = 0; i < r.gauge.size(); ++i)
    add(r.gauges[static_cast<std::size_t>(i)], std::abs(r.gauge(i)),
        sigmas_of_gauge(r, i, weights));
  return all;
}

std::vector<SuspectPose> suspects_of(const MeasurementBatch& batch, const Residuals& r,
                                     const Weights& weights) {
  const std::vector<SuspectPose> all = off_by(batch, r, weights);
  const auto positions = static_cast<std::size_t>(r.position.cols());
  std::vector<SuspectPose> suspects;
  for (std::size_t i = 0; i < all.size(); ++i)
    if (all[i].sigmas > (i < positions ? kSuspect : kSuspectGauge)) suspects.push_back(all[i]);
  std::sort(suspects.begin(), suspects.end(),
            [](const auto& a, const auto& b) { return a.sigmas > b.sigmas; });
  return suspects;
}

double log_likelihood(const Residuals& r, const Weights& weights) {
  double sum = 0;
  const auto add = [&](const auto& residual, double sigma, double discrepancy) {
    const double variance = sigma * sigma + discrepancy * discrepancy;
    const double square = std::min(residual.squaredNorm() / variance, kSuspect * kSuspect);
    sum -= 0.5 * square + 1.5 * std::log(2 * kPi * variance);
  };
  for (const std::vector<Eigen::Index>& columns : r.together)
    sum += log_likelihood_together(r, columns, weights);
  for (Eigen::Index i = 0; r.together.empty() && i < r.position.cols(); ++i)
    add(r.position.col(i), r.sigma(i), weights.discrepancy);
  for (Eigen::Index i = 0; i < r.rotation.cols(); ++i) {
    add(r.rotation.col(i), r.sigma_rotation(i), weights.discrepancy_rotation);
  }
  for (Eigen::Index i = 0; i < r.gauge.size(); ++i) {
    const double sigmas = std::min(sigmas_of_gauge(r, i, weights), kSuspectGauge);
    sum -= 0.5 * sigmas * sigmas + 0.5 * std::log(2 * kPi * variance_of_gauge(r, i, weights));
  }
  return sum;
}

}  // namespace trammel
