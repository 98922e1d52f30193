#include "server/calibrate/identify/identify.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "server/base/units.h"
#include "server/calibrate/identify/gauss_newton.h"
#include "server/calibrate/identify/minimise.h"
#include "server/calibrate/identify/own_noise.h"
#include "server/calibrate/identify/weighted_pose.h"
#include "server/measurement/gauges.h"
#include "server/measurement/pose_groups.h"
#include "server/measurement/sessions.h"
#include "server/numerics/product.h"

namespace trammel {

namespace {

constexpr int kMostReweightings =
    12;  // three or four are enough; more only where outliers come and go
constexpr double kIdentifiedShare =
    0.5;  // share of the prior's standard deviation: below it the data say more than the prior
constexpr double kFewFitted = 0.05;  // share of the equations; below it, the split of the
                                     // parameters hardly changes the discrepancies

/// (N + 1)^-1 = Lᵀ L, N the information: L, lower triangular.
Eigen::MatrixXd root_of_posterior(const Eigen::MatrixXd& information) {
  const Eigen::Index P = information.rows();
  return inverse_factor(information + Eigen::MatrixXd::Identity(P, P))
      .value_or(Eigen::MatrixXd::Identity(P, P));
}

/// The number of parameters that the data, not the priors, decide: the trace of N (N + 1)^-1.
double freedom_of(const Eigen::MatrixXd& information) {
  return static_cast<double>(information.rows()) - root_of_posterior(information).squaredNorm();
}

/// The number of parameters that a part of the measurements decides, given its information `part`.
double freedom_of(const Eigen::MatrixXd& part, const Eigen::MatrixXd& information) {
  const Eigen::MatrixXd root = root_of_posterior(information);
  return (root * part).cwiseProduct(root).sum();
}

Information decomposed(const Eigen::MatrixXd& information) {
  if (information.size() == 0) return {};
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(information);
  return {eigen.eigenvalues().cwiseMax(0).cwiseSqrt(), eigen.eigenvectors()};
}

/// m: how far positions or gauges are off (`square`, m²) but for the tenth that is farthest: single
/// wrong rows make no batch wrong, and are suspects.
double rms_of_most(Eigen::VectorXd square) {
  std::sort(square.begin(), square.end());
  const Eigen::Index most = square.size() - square.size() / 10;
  return std::sqrt(square.head(most).mean());
}

/// Refuses joints and positions of different robots. Then `rms` (m), the residual of the
/// identification, is a large part of the tool's path.
Status check_positions_belong(const MeasurementBatch& batch, double rms) {
  Vector3 mean = Vector3::Zero();
  for (const Measurement& m : batch.measurements)
    mean += m.p_W / static_cast<double>(batch.measurements.size());
  double square = 0;
  for (const Measurement& m : batch.measurements) square += (m.p_W - mean).squaredNorm();
  const double spread = std::sqrt(square / static_cast<double>(batch.measurements.size()));
  if (rms < std::max(kNoModelError, kNoModelShare * spread)) return {};
  return refused(
             "{:.0f} mm rms are left after identification, of positions that spread over {:.0f} "
             "mm: these joints do not lead to these positions",
             to_mm(rms), to_mm(spread))
      .in("batch " + batch.id)
      .of("x_mm")
      .beyond(to_mm(rms), to_mm(std::max(kNoModelError, kNoModelShare * spread)))
      .next(
          "look at the order of the joints, their signs and zeros, which row belongs to which "
          "position and to which reflector (tool_id), and at a base that the cell file says and no "
          "error source finds");
}

/// Checks the same for contacts, whose places have no spread: `rms` (m) is of their residuals.
Status check_contacts_belong(const MeasurementBatch& batch, double rms) {
  if (rms < kNoModelError) return {};
  return refused(
             "the tool points at one place are {:.0f} mm rms apart after identification, limit "
             "{:.0f} "
             "mm: these joints do not lead to one point",
             to_mm(rms), to_mm(kNoModelError))
      .in("batch " + batch.id)
      .of("distance_mm")
      .beyond(to_mm(rms), to_mm(kNoModelError))
      .next(
          "look at the tool of the cell file, the joints' order, signs and zeros, and which row "
          "belongs to which point");
}

/// Checks the same for gauges.
Status check_gauges_belong(const MeasurementBatch& batch, double rms) {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const Measurement& m : batch.measurements) {
    if (!m.gauge || m.gauge->kind == Gauge::Kind::kContact) continue;
    low = std::min(low, m.gauge->value);
    high = std::max(high, m.gauge->value);
  }
  const double limit = std::max(kNoModelError, kNoModelShare * (high - low));
  if (rms < limit) return {};
  return refused(
             "{:.0f} mm rms are left after identification, of values between {:.0f} and {:.0f} mm: "
             "these joints do not lead to these distances",
             to_mm(rms), to_mm(low), to_mm(high))
      .in("batch " + batch.id)
      .of("distance_mm")
      .beyond(to_mm(rms), to_mm(limit))
      .next(
          "look at the base and tool of the cell file, the joints' order, signs and zeros, and "
          "which row belongs to which anchor");
}

Status check_belongs(const MeasurementBatch& batch, const Residuals& r) {
  if (r.gauge.size() > 0) {
    const Status gauges = check_gauges_belong(batch, rms_of_most(r.gauge.cwiseAbs2()));
    if (!gauges || r.position.cols() == 0) return gauges;
  }
  const double rms = rms_of_most(r.position.colwise().squaredNorm().transpose());
  if (!has_positions(batch)) return check_contacts_belong(batch, rms);
  return check_positions_belong(has_gauges(batch) ? positions_of(batch) : batch, rms);
}

/// Adds the observability of the directions: their number, and the least and geometric mean of
/// their singular values.
void add_observability(const Information& seen, std::size_t poses, CalibrationResult& result) {
  double least = std::numeric_limits<double>::infinity();
  double log_sum = 0;
  for (Eigen::Index k = 0; k < seen.singular_values.size(); ++k) {
    const double value = seen.singular_values(k);
    if (value < 1) continue;
    ++result.rank;
    least = std::min(least, value);
    log_sum += std::log(value);
  }
  if (result.rank == 0) return;
  result.observability_index =
      std::exp(log_sum / result.rank) / std::sqrt(static_cast<double>(poses));
  result.condition_number = seen.singular_values(seen.singular_values.size() - 1) / least;
}

/// Adds covariance, rank and unidentifiable directions, from the information that `poses` poses
/// give about the free parameters. Held parameters are exact.
void add_posterior(const Eigen::MatrixXd& information, const ScaledParameters& s, std::size_t poses,
                   CalibrationResult& result) {
  const Information seen = decomposed(information);
  const Eigen::VectorXd variance = (seen.singular_values.array().square() + 1).inverse();
  const Eigen::MatrixXd scaled_covariance =
      seen.directions * variance.asDiagonal() * seen.directions.transpose();
  result.covariance(s.free, s.free) =
      s.scale.asDiagonal() * scaled_covariance * s.scale.asDiagonal();
  add_observability(seen, poses, result);
  const Eigen::VectorXd from_prior = result.model.values(s.free).cwiseQuotient(s.scale) - s.prior;
  result.log_evidence =
      result.log_likelihood - 0.5 * from_prior.squaredNorm() + 0.5 * variance.array().log().sum();
  result.unidentifiable =
      unidentifiable_combinations(seen, s.parameters, s.scale.cwiseQuotient(s.typical));
  for (Parameter& parameter : result.model.parameters())
    result.parameters.push_back(
        {.parameter = std::move(parameter), .value = 0, .stddev = 0, .identified = true});
  for (Eigen::Index i = 0; i < s.values.size(); ++i) {
    IdentifiedParameter& one = result.parameters[static_cast<std::size_t>(i)];
    one.value = result.model.values(i);
    one.parameter.prior = s.values(i);
  }
  for (std::size_t k = 0; k < s.free.size(); ++k) {
    IdentifiedParameter& one = result.parameters[static_cast<std::size_t>(s.free[k])];
    one.parameter = s.parameters[k];
    one.stddev = std::sqrt(result.covariance(s.free[k], s.free[k]));
    one.identified = one.stddev < kIdentifiedShare * s.typical(static_cast<Eigen::Index>(k));
  }
}

/// Identified parameters, their residuals, and the weights of the fit.
struct Identified {
  Minimum minimum;
  Residuals residuals;
  Weights weights;
  std::vector<SessionSetting> sessions;
};

/// Moves the measurements into W as at the minimum, and gives every session its own noise.
void take_over_sessions(const MeasurementBatch& given, Identified& now, MeasurementBatch& batch,
                        const Tracker& tracker) {
  if (now.sessions.empty()) return;
  for (std::size_t s = 0; s < now.sessions.size(); ++s)
    now.sessions[s].set_into_W(now.minimum.moved[s] * now.sessions[s].into_W());
  batch = moved(given, now.sessions, tracker.sigma, tracker.sigma_rotation);
}

/// The number of parameters that the sessions took from the data.
double freedom_of_sessions(const CalibrationProblem& problem) {
  if (!has_sessions(problem.batch)) return 0;
  return (problem.stretched ? 7.0 : 6.0) * static_cast<double>(problem.batch.sessions.size() - 1);
}

/// The information of the mean positions at one joint vector about the parameters, each mean with
/// the weight of one position.
Eigen::MatrixXd information_of_means(const CalibrationProblem& problem, const ScaledParameters& s,
                                     const Weights& weights, const Residuals& r,
                                     const Eigen::VectorXd& x) {
  const Eigen::Index P = s.scale.size();
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(P, P), J(P, 6);
  Eigen::VectorXd residual(6);
  for (const std::vector<Eigen::Index>& columns : r.together) {
    Eigen::MatrixXd mean = Eigen::MatrixXd::Zero(P, 3);
    for (const Eigen::Index column : columns) {
      const Eigen::Index row = r.positions[static_cast<std::size_t>(column)];
      const auto at = static_cast<std::size_t>(row);
      const WeightedPose pose(problem.model, s, problem.batch.measurements[at], weights, at);
      if (pose.evaluate(x.data(), residual.data(), J.data())) mean += J.leftCols(3);
    }
    sum.noalias() += mean * mean.transpose() / static_cast<double>(columns.size());
  }
  return sum;
}

/// The number of parameters that each kind of residual decides at the minimum under `weights`. With
/// few parameters beside many equations, or with several sessions, the parameters are split by the
/// number of equations. Otherwise positions may have decided most of them, and are fitted much
/// closer than orientations.
Freedom fitted(const CalibrationProblem& problem, const ScaledParameters& s, const Weights& weights,
               bool robust, const Minimum& at) {
  double turns = 0, equations = 0;
  for (const Measurement& m : problem.batch.measurements) {
    turns += !m.gauge && m.R_WT ? 3 : 0;
    equations += m.gauge ? m.gauge->numbers() : m.R_WT ? 6 : 3;
  }
  const double all = freedom_of(at.information) + freedom_of_sessions(problem);
  const double by_number = all * turns / equations;
  if (turns == 0 || has_sessions(problem.batch) || all < kFewFitted * equations)
    return {all - by_number, by_number};
  Weights turns_alone = weights;
  turns_alone.discrepancy = std::numeric_limits<double>::infinity();
  const double decided =
      freedom_of(expand(problem, s, turns_alone, robust, at.x).information, at.information);
  return {all - decided, decided};
}

/// The number of parameters fitted to the means of the positions at one joint vector.
double fitted_to_means(const CalibrationProblem& problem, const ScaledParameters& s,
                       const Identified& now) {
  const Eigen::MatrixXd means =
      information_of_means(problem, s, now.weights, now.residuals, now.minimum.x);
  return freedom_of(means, now.minimum.information) + freedom_of_sessions(problem);
}

/// Sets the excess noise of each session and the new sigmas of the residuals. Returns false if
/// nothing changed.
bool estimate_own_noise(Identified& now, const Freedom& freedom, const MeasurementBatch& given,
                        MeasurementBatch& batch, const Tracker& tracker) {
  std::vector<SessionSetting> sessions = now.sessions;
  set_own_noise(now.residuals, freedom, now.weights, batch, sessions);
  const bool same = are_as_noisy(sessions, now.sessions, tracker);
  now.sessions = std::move(sessions);
  batch = moved(given, now.sessions, tracker.sigma, tracker.sigma_rotation);
  set_sigmas(batch, tracker, now.residuals);
  return same;
}

/// Minimises and estimates the discrepancy in turns until neither changes; adds the iterations to
/// `result`.
Result<Identified> settle(const CalibrationProblem& problem, const CalibrateOptions& options,
                          const ScaledParameters& s, CalibrationResult& result) {
  const Tracker& tracker = problem.model.cell->tracker;
  CalibrationProblem working = problem;
  Identified now;
  now.sessions = settings_of(problem.batch);
  now.weights.together = counted_together(problem.batch);
  now.minimum.x = s.prior;
  now.minimum.converged = s.scale.size() == 0;
  now.minimum.message = "nothing to identify";
  for (int round = 0; round < kMostReweightings; ++round) {
    Freedom freedom;
    if (s.scale.size() > 0) {
      Minimum found = TRY(minimise(working, s, now.weights, options, now.minimum.x));
      now.minimum = std::move(found);
      result.iterations += static_cast<int>(now.minimum.costs.size());
      result.cost_record.insert(result.cost_record.end(), now.minimum.costs.begin(),
                                now.minimum.costs.end());
      freedom = fitted(working, s, now.weights, is_robust(options, now.weights), now.minimum);
      take_over_sessions(problem.batch, now, working.batch, tracker);
    }
    now.residuals = residuals_of(problem.model, working.batch, s.values_at(now.minimum.x));
    if (!now.weights.together.empty())
      now.residuals.together = columns_together(working.batch, now.residuals);
    if (s.scale.size() > 0 && !now.residuals.together.empty())
      freedom.means = fitted_to_means(working, s, now);
    const bool same_noise = now.sessions.empty() ||
                            estimate_own_noise(now, freedom, problem.batch, working.batch, tracker);
    const Weights before = now.weights;
    now.weights = estimated_weights(now.residuals, freedom, before, is_robust(options, before));
    if (same_noise && are_settled(now.weights, before, tracker)) break;
  }
  // The last step is short in general, but long beside parameters that show only as a product:
  // there the derivatives change.
  if (now.sessions.empty() && s.scale.size() > 0)
    now.minimum.information =
        expand(problem, s, now.weights, is_robust(options, now.weights), now.minimum.x).information;
  return now;
}

}  // namespace

Result<CalibrationResult> identify(const CalibrationProblem& problem,
                                   const CalibrateOptions& options) {
  const ScaledParameters s = scaled_parameters(problem.model, options.held);
  const Eigen::Index P = s.values.size();
  CalibrationResult result;
  result.model = problem.model;
  const Identified found = TRY(settle(problem, options, s, result));
  const Residuals& r = found.residuals;
  result.model.values = s.values_at(found.minimum.x);
  result.discrepancy = found.weights.discrepancy;
  result.discrepancy_rotation = found.weights.discrepancy_rotation;
  result.discrepancy_of_pose = found.weights.of_pose;
  result.log_evidence = result.log_likelihood = log_likelihood(r, found.weights);
  result.suspects = suspects_of(problem.batch, r, found.weights);
  result.rms = r.rms();
  result.converged = found.minimum.converged;
  result.sessions = found.sessions;
  result.message = found.minimum.message;
  result.covariance = Eigen::MatrixXd::Zero(P, P);
  if (P == 0) return result;
  TRY(check_belongs(problem.batch, r));
  add_posterior(found.minimum.information, s, problem.batch.measurements.size(), result);
  return result;
}

}  // namespace trammel
