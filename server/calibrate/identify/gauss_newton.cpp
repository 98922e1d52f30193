#include "server/calibrate/identify/gauss_newton.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "server/calibrate/identify/weighted_pose.h"

namespace trammel {

namespace {

constexpr double kSettledStep = 0.05;       // standard deviations: a smaller step changes nothing anybody sees
constexpr double kFirstSettledStep = 1;     // the same as long as residuals only serve to find the discrepancy
constexpr double kNoRise = 1e-6;            // of the cost, which has thousands of terms: rounding
constexpr Eigen::Index kPosesAtATime = 64;  // whose Jacobians are multiplied together: they stay in the cache

/// The Gauss-Newton step from the point of `at`. Parameters at their bound that would leave it stay.
Eigen::VectorXd bounded_step(const Expansion& at, const Eigen::VectorXd& x, const Eigen::VectorXd& lower) {
  Eigen::VectorXd downhill = -at.gradient;
  Eigen::MatrixXd curvature = at.information;
  curvature.diagonal().array() += 1;
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    if (x(i) > lower(i) || downhill(i) >= 0) continue;
    downhill(i) = 0;
    curvature.row(i).setZero();
    curvature.col(i).setZero();
    curvature(i, i) = 1;
  }
  return (x + curvature.llt().solve(downhill)).cwiseMax(lower) - x;
}

}  // namespace

Expansion expand(const CalibrationProblem& problem, const ScaledParameters& s, const Weights& weights, bool robust,
                 const Eigen::VectorXd& x) {
  const Eigen::Index P = s.scale.size();
  const Eigen::VectorXd from_prior = x - s.prior;
  Expansion at{0.5 * from_prior.squaredNorm(), from_prior, Eigen::MatrixXd::Zero(P, P)};
  Eigen::MatrixXd jacobians(P, 6 * kPosesAtATime);  // one column an equation
  Eigen::VectorXd residuals(6 * kPosesAtATime);
  Eigen::Index filled = 0;
  const auto add_filled = [&] {
    if (filled == 0) return;  // Eigen's rank update divides by the number of columns
    const auto J = jacobians.leftCols(filled);
    at.gradient.noalias() += J * residuals.head(filled);
    at.information.selfadjointView<Eigen::Lower>().rankUpdate(J);
    filled = 0;
  };
  for (const Measurement& m : problem.batch.measurements) {
    const WeightedPose pose(problem.model, s, m, weights);
    const bool finite = pose.evaluate(x.data(), residuals.data() + filled, jacobians.col(filled).data());
    auto r = residuals.segment(filled, pose.size());
    const double norm = finite ? r.norm() : std::numeric_limits<double>::infinity();
    const double limit = pose.huber_limit();
    if (robust && norm > limit) {
      const double root_weight = std::sqrt(limit / norm);
      r *= root_weight;
      jacobians.middleCols(filled, pose.size()) *= root_weight;
      at.cost += limit * (norm - 0.5 * limit);
    } else {
      at.cost += 0.5 * norm * norm;
    }
    filled += pose.size();
    if (filled + 6 > residuals.size()) add_filled();
  }
  add_filled();
  at.information = Eigen::MatrixXd(at.information.selfadjointView<Eigen::Lower>());
  return at;
}

bool is_robust(const CalibrateOptions& options, const Weights& weights) { return options.robust && weights.estimated; }

std::optional<Minimum> full_steps(const CalibrationProblem& problem, const ScaledParameters& s, const Weights& weights,
                                  const CalibrateOptions& options, const Eigen::VectorXd& start) {
  const Eigen::VectorXd lower = s.lower();
  Minimum now{start.cwiseMax(lower), {}, {}, false, "too many steps"};
  for (int k = 0; k < std::max(1, options.max_iterations) && !now.converged; ++k) {
    Expansion at = expand(problem, s, weights, is_robust(options, weights), now.x);
    if (!std::isfinite(at.cost) || (k > 0 && at.cost > now.costs.back() + kNoRise)) return std::nullopt;
    now.costs.push_back(at.cost);
    const Eigen::VectorXd step = bounded_step(at, now.x, lower);
    const double in_standard_deviations = std::sqrt(step.dot(at.information * step) + step.squaredNorm());
    now.x += step;
    now.information = std::move(at.information);
    if (in_standard_deviations < (weights.estimated ? kSettledStep : kFirstSettledStep)) {
      now.converged = true;
      now.message = fmt::format("last step {:.1e} standard deviations", in_standard_deviations);
    }
  }
  return now;
}

}  // namespace trammel
