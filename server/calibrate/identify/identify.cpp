#include "server/calibrate/identify/identify.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "server/base/units.h"
#include "server/calibrate/identify/minimise.h"

namespace trammel {

namespace {

constexpr int kMaxReweightings = 12;
constexpr double kIdentifiedShare = 0.5;  // of the prior's standard deviation, at most, is left of what was not known
constexpr double kNoModelError = 0.025;   // m rms: what no model of a robot leaves,
constexpr double kNoModelShare = 0.05;    // and of how far the positions spread

/// How many parameters the data, not the priors, decide: the trace of N (N + 1)^-1.
double freedom_of(const Eigen::MatrixXd& information) {
  const Eigen::Index P = information.rows();
  const Eigen::MatrixXd identity = Eigen::MatrixXd::Identity(P, P);
  return static_cast<double>(P) - (information + identity).llt().solve(identity).trace();
}

Information decomposed(const Eigen::MatrixXd& information) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(information);
  return {eigen.eigenvalues().cwiseMax(0).cwiseSqrt(), eigen.eigenvectors()};
}

/// Whether joints and positions can be of one robot at all: what identification leaves, `rms` (m), is no model's error
/// where it is a good part of the way that the tool went.
Status check_belongs(const MeasurementBatch& batch, double rms) {
  Vector3 mean = Vector3::Zero();
  for (const Measurement& m : batch.measurements) mean += m.p_W / static_cast<double>(batch.measurements.size());
  double square = 0;
  for (const Measurement& m : batch.measurements) square += (m.p_W - mean).squaredNorm();
  const double spread = std::sqrt(square / static_cast<double>(batch.measurements.size()));
  if (rms < std::max(kNoModelError, kNoModelShare * spread)) return {};
  return refused(
             "{:.0f} mm rms are left after identification, of positions that spread over {:.0f} mm: these joints do "
             "not lead to these positions",
             to_mm(rms), to_mm(spread))
      .in("batch " + batch.id)
      .of("x_mm")
      .beyond(to_mm(rms), to_mm(std::max(kNoModelError, kNoModelShare * spread)))
      .next("look at the order of the joints, their signs and zeros, and which row belongs to which position");
}

/// Covariance, rank and what remains hidden, from what `poses` poses say of the parameters that are not held.
void add_posterior(const Eigen::MatrixXd& information, const ScaledParameters& s, std::size_t poses,
                   CalibrationResult& result) {
  const auto P = s.scale.size();
  std::vector<Eigen::Index> free;
  std::vector<Parameter> parameters;
  for (Eigen::Index i = 0; i < P; ++i) {
    if (!s.held.empty() && s.held[static_cast<std::size_t>(i)]) continue;
    free.push_back(i);
    parameters.push_back(s.parameters[static_cast<std::size_t>(i)]);
  }
  const Information seen = decomposed(information(free, free));
  const Eigen::VectorXd variance = (seen.singular_values.array().square() + 1).inverse();
  const Eigen::MatrixXd scaled_covariance = seen.directions * variance.asDiagonal() * seen.directions.transpose();
  const Eigen::VectorXd scale = s.scale(free);
  result.covariance(free, free) = scale.asDiagonal() * scaled_covariance * scale.asDiagonal();
  double least = std::numeric_limits<double>::infinity();
  double log_sum = 0;
  for (Eigen::Index k = 0; k < scale.size(); ++k) {
    const double value = seen.singular_values(k);
    if (value < 1) continue;
    ++result.rank;
    least = std::min(least, value);
    log_sum += std::log(value);
  }
  if (result.rank > 0) {
    result.observability_index = std::exp(log_sum / result.rank) / std::sqrt(static_cast<double>(poses));
  }
  result.unidentifiable = unidentifiable_combinations(seen, parameters, scale.cwiseQuotient(s.typical(free)));
  result.condition_number = result.rank > 0 ? seen.singular_values(scale.size() - 1) / least : 0;
  for (Eigen::Index i = 0; i < P; ++i) {
    const Parameter& parameter = s.parameters[static_cast<std::size_t>(i)];
    const double stddev = std::sqrt(result.covariance(i, i));
    result.parameters.push_back({parameter, result.model.values(i), stddev, stddev < kIdentifiedShare * s.typical(i)});
  }
}

}  // namespace

Result<CalibrationResult> identify(const CalibrationProblem& problem, const CalibrateOptions& options) {
  const PhysicalModel& model = problem.model;
  const Tracker& tracker = model.cell->tracker;
  const ScaledParameters s = scaled_parameters(model, options.held);
  const auto P = s.scale.size();
  CalibrationResult result;
  result.model = model;
  Weights weights;
  Minimum minimum;
  minimum.x = model.values.cwiseQuotient(s.scale);
  minimum.converged = P == 0;
  minimum.message = "nothing to identify";
  Residuals r;
  for (int round = 0; round < kMaxReweightings; ++round) {
    double freedom = 0;
    if (P > 0) {
      Result<Minimum> found = minimise(problem, s, weights, options, minimum.x);
      if (!found) return tl::make_unexpected(found.error());
      minimum = std::move(*found);
      result.iterations += static_cast<int>(minimum.costs.size());
      result.cost_record.insert(result.cost_record.end(), minimum.costs.begin(), minimum.costs.end());
      freedom = freedom_of(minimum.information);
    }
    r = residuals_of(model, problem.batch, minimum.x.cwiseProduct(s.scale));
    const Weights before = weights;
    weights = estimated_weights(r, freedom, before, is_robust(options, before), tracker.sigma_rotation);
    if (are_settled(weights, before, tracker)) break;
  }
  result.model.values = minimum.x.cwiseProduct(s.scale);
  result.discrepancy = weights.discrepancy;
  result.discrepancy_rotation = weights.discrepancy_rotation;
  result.log_likelihood = log_likelihood(r, weights, tracker.sigma_rotation);
  result.suspects = suspects_of(problem.batch, r, weights);
  result.rms = std::sqrt(r.position.squaredNorm() / static_cast<double>(r.position.cols()));
  result.converged = minimum.converged;
  result.message = minimum.message;
  result.covariance = Eigen::MatrixXd::Zero(P, P);
  if (P == 0) return result;
  if (const Status belongs = check_belongs(problem.batch, result.rms); !belongs)
    return tl::make_unexpected(belongs.error());
  add_posterior(minimum.information, s, problem.batch.measurements.size(), result);
  return result;
}

}  // namespace trammel
