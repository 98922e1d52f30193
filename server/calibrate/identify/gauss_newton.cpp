#include "server/calibrate/identify/gauss_newton.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "server/calibrate/identify/weighted_pose.h"
#include "server/measurement/sessions.h"
#include "server/numerics/product.h"

namespace trammel {

namespace {

constexpr double kSettledStep =
    0.05;  // standard deviations: a smaller step changes nothing anybody sees
constexpr double kFirstSettledStep =
    1;                            // likewise, while the fit only serves to estimate the discrepancy
constexpr double kNoRise = 1e-6;  // of the cost, which has thousands of terms: rounding
constexpr Eigen::Index kPosesAtATime =
    64;  // poses whose Jacobians are multiplied together, so that they stay in the cache

constexpr Eigen::Index kManyParameters = 300;  // from here on the product takes most of the time

constexpr double kFirstDamping = 1e-3;  // share of the diagonal, for the first damped step
constexpr double kMostDamping = 1e9;
constexpr double kNoDamping = 1e-6;

// Where the poses determine only a product of numbers, damped steps follow a bent valley for a
// hundred steps. Only the prior's part of the cost still falls then, by less than this.
constexpr double kIdleFall = 0.05;  // nat a step
constexpr double kFirstIdleShare =
    1e-3;  // share of the cost, while the fit only serves to estimate the discrepancy
constexpr int kIdleSteps = 3;
// A full step along such a valley leaves it, and the next ones come back, farther down.
constexpr int kMostUphill = 5;  // steps

/// The Gauss-Newton step from the point of `at`. A parameter at its bound stays there if the step
/// would leave the bound.
Eigen::VectorXd bounded_step(const Expansion& at, const Eigen::VectorXd& x,
                             const Eigen::VectorXd& lower) {
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

/// The normal equations, filled row by row: a chunk of rows at a time, always of one session.
class Normals {
 public:
  Normals(Expansion& at, std::size_t sessions)
      : at_(at),
        jacobians_(at.gradient.size(), 6 * kPosesAtATime),
        motions_(kOfSession, sessions > 1 ? 6 * kPosesAtATime : 0),
        residuals_(6 * kPosesAtATime),
        newest_(static_cast<int>(sessions) - 1) {
    if (sessions < 2) return;
    at_.sessions.resize(sessions - 1);
    for (SessionBlock& block : at_.sessions)
      block.cross = Eigen::MatrixXd::Zero(kOfSession, at.gradient.size());
  }
  /// Begins the next pose, which belongs to that session, and points at the rows for its residuals
  /// and derivatives.
  void begin(int session) {
    if (session != session_ || filled_ + 6 > residuals_.size()) add_filled();
    session_ = session;
  }
  [[nodiscard]] double* residuals() { return residuals_.data() + filled_; }
  [[nodiscard]] double* jacobian() { return jacobians_.col(filled_).data(); }
  [[nodiscard]] auto residuals(Eigen::Index count) { return residuals_.segment(filled_, count); }
  [[nodiscard]] bool moves() const { return session_ < newest_; }
  void set_motion(const SessionColumns& columns) {
    motions_.middleCols(filled_, columns.cols()) = columns;
  }
  void weigh(Eigen::Index count, double root_weight) {
    residuals_.segment(filled_, count) *= root_weight;
    jacobians_.middleCols(filled_, count) *= root_weight;
    if (moves()) motions_.middleCols(filled_, count) *= root_weight;
  }
  void end(Eigen::Index count) { filled_ += count; }
  void add_filled() {
    if (filled_ == 0) return;  // Eigen's rank update divides by the number of columns
    const auto J = jacobians_.leftCols(filled_);
    const auto r = residuals_.head(filled_);
    at_.gradient.noalias() += J * r;
    if (J.rows() < kManyParameters) {
      at_.information.selfadjointView<Eigen::Lower>().rankUpdate(J);
    } else {
      at_.information += gram(J.transpose());
    }
    if (moves()) {
      const auto D = motions_.leftCols(filled_);
      SessionBlock& block = at_.sessions[static_cast<std::size_t>(session_)];
      block.gradient.noalias() += D * r;
      block.curvature.noalias() += D * D.transpose();
      block.cross.noalias() += D * J.transpose();
    }
    filled_ = 0;
  }

 private:
  Expansion& at_;
  Eigen::MatrixXd jacobians_;  // one column an equation
  Eigen::MatrixXd motions_;
  Eigen::VectorXd residuals_;
  int newest_ = 0, session_ = 0;
  Eigen::Index filled_ = 0;
};

}  // namespace

Expansion expand(const CalibrationProblem& problem, const ScaledParameters& s,
                 const Weights& weights, bool robust, const Eigen::VectorXd& x) {
  const Eigen::Index P = s.scale.size();
  const Eigen::VectorXd from_prior = x - s.prior;
  Expansion at{0.5 * from_prior.squaredNorm(), from_prior, Eigen::MatrixXd::Zero(P, P)};
  const std::size_t sessions = problem.batch.sessions.size();
  Normals normals(at, sessions);
  for (std::size_t row = 0; row < problem.batch.measurements.size(); ++row) {
    const Measurement& m = problem.batch.measurements[row];
    const WeightedPose pose(problem.model, s, m, weights, row);
    normals.begin(sessions > 1 ? m.session : 0);
    const bool finite = pose.evaluate(x.data(), normals.residuals(), normals.jacobian());
    const double norm =
        finite ? normals.residuals(pose.size()).norm() : std::numeric_limits<double>::infinity();
    const double limit = pose.huber_limit();
    if (normals.moves()) {
      normals.set_motion(motion_columns(m, problem.model.X_WB.translation(), pose.inverse_sigma(),
                                        pose.inverse_rotation_sigma(), problem.stretched));
    }
    if (robust && norm > limit) {
      normals.weigh(pose.size(), std::sqrt(limit / norm));
      at.cost += limit * (norm - 0.5 * limit);
    } else {
      at.cost += 0.5 * norm * norm;
    }
    normals.end(pose.size());
  }
  normals.add_filled();
  at.information = Eigen::MatrixXd(at.information.selfadjointView<Eigen::Lower>());
  return at;
}

bool is_robust(const CalibrateOptions& options, const Weights& weights) {
  return options.robust && weights.estimated;
}

std::optional<Minimum> full_steps(const CalibrationProblem& problem, const ScaledParameters& s,
                                  const Weights& weights, const CalibrateOptions& options,
                                  const Eigen::VectorXd& start) {
  const Eigen::VectorXd lower = s.lower();
  Minimum now{start.cwiseMax(lower), {}, {}, false, "too many steps"};
  for (int k = 0; k < std::max(1, options.max_iterations) && !now.converged; ++k) {
    Expansion at = expand(problem, s, weights, is_robust(options, weights), now.x);
    if (!std::isfinite(at.cost) || (k > 0 && at.cost > now.costs.back() + kNoRise))
      return std::nullopt;
    now.costs.push_back(at.cost);
    const Eigen::VectorXd step = bounded_step(at, now.x, lower);
    const double in_standard_deviations =
        std::sqrt(step.dot(at.information * step) + step.squaredNorm());
    now.x += step;
    now.information = std::move(at.information);
    if (in_standard_deviations < (weights.estimated ? kSettledStep : kFirstSettledStep)) {
      now.converged = true;
      now.message = fmt::format("last step {:.1e} standard deviations", in_standard_deviations);
    }
  }
  return now;
}

namespace {

/// The present point of the search: the parameters, and the measurements with the instruments
/// placed accordingly.
struct Standing {
  Eigen::VectorXd x;
  CalibrationProblem problem;
  std::vector<Similarity> moved;
  Expansion at;
};

void move_sessions(Standing& standing, const std::vector<SessionMotion>& motions) {
  std::vector<Similarity> by;
  for (const SessionMotion& motion : motions) {
    by.push_back(measured_by(motion, standing.problem.model.X_WB.translation()));
    standing.moved[by.size() - 1] = by.back() * standing.moved[by.size() - 1];
  }
  for (Measurement& m : standing.problem.batch.measurements) {
    const auto session = static_cast<std::size_t>(m.session);
    if (session >= by.size()) continue;
    m.p_W = by[session] * m.p_W;
    if (m.R_WT) m.R_WT = (by[session].X.linear() * *m.R_WT).eval();
  }
}

/// A step of everything, and how long it is.
struct JointStep {
  Eigen::VectorXd parameters;
  std::vector<SessionMotion> motions;
  double in_standard_deviations = 0;
};

JointStep joint_step(const Standing& from, const Eigen::VectorXd& lower, double damping) {
  Expansion reduced{from.at.cost, from.at.gradient, from.at.information};
  reduced.information.diagonal() *= 1 + damping;
  eliminate(from.at.sessions, reduced.information, reduced.gradient, damping);
  JointStep step{bounded_step(reduced, from.x, lower), {}, 0};
  double square =
      step.parameters.dot(from.at.information * step.parameters) + step.parameters.squaredNorm();
  for (const SessionBlock& block : from.at.sessions) {
    const SessionMotion motion = block.motion(step.parameters, damping);
    square += motion.dot(block.curvature * motion) + 2 * motion.dot(block.cross * step.parameters);
    step.motions.push_back(motion);
  }
  step.in_standard_deviations = std::sqrt(std::max(0.0, square));
  return step;
}

Minimum minimum_at(const Standing& standing, std::vector<double> costs) {
  Minimum found{standing.x, standing.at.information, std::move(costs),
                false,      "too many steps",        standing.moved};
  Eigen::VectorXd gradient = standing.at.gradient;
  eliminate(standing.at.sessions, found.information, gradient);
  return found;
}

/// A search downhill. A full step may lead uphill for a while; then it goes back to the best point,
/// and is damped.
struct Descent {
  Standing now, best;
  double damping = 0;
  int idle = 0;    // steps in a row that gained nothing
  int uphill = 0;  // undamped steps since the best point

  explicit Descent(Standing start) : now(std::move(start)), best(now) {}
  [[nodiscard]] bool is_higher() const {
    return !std::isfinite(now.at.cost) || now.at.cost > best.at.cost * (1 + 1e-12) + kNoRise;
  }
  /// After a step to a higher point that was not the last one. False: nothing leads downhill.
  bool go_on_or_back(bool settled) {
    if (damping == 0 && !settled && std::isfinite(now.at.cost) && ++uphill < kMostUphill)
      return true;
    now = best;
    uphill = 0;
    damping = std::max(10 * damping, kFirstDamping);
    return damping <= kMostDamping;
  }
  void accept(double idle_fall) {
    if (!is_higher()) {
      idle = best.at.cost - now.at.cost < idle_fall ? idle + 1 : 0;
      best = now;
    }
    uphill = 0;
    damping = damping < kNoDamping ? 0 : damping / 10;
  }
};

}  // namespace

Result<Minimum> session_steps(const CalibrationProblem& problem, const ScaledParameters& s,
                              const Weights& weights, const CalibrateOptions& options,
                              const Eigen::VectorXd& start) {
  const Eigen::VectorXd lower = s.lower();
  const bool robust = is_robust(options, weights);
  const auto expand_now = [&](Standing& here) {
    here.at = expand(here.problem, s, weights, robust, here.x);
  };
  Standing first{
      start.cwiseMax(lower), problem, std::vector<Similarity>(problem.batch.sessions.size()), {}};
  expand_now(first);
  Descent search(std::move(first));
  std::vector<double> costs = {search.now.at.cost};
  for (int k = 0; k < std::max(1, options.max_iterations) && std::isfinite(search.best.at.cost);
       ++k) {
    const JointStep step = joint_step(search.now, lower, search.damping);
    const bool settled =
        search.damping == 0 &&
        step.in_standard_deviations < (weights.estimated ? kSettledStep : kFirstSettledStep);
    search.now.x += step.parameters;
    move_sessions(search.now, step.motions);
    expand_now(search.now);
    if (search.is_higher() && !(settled && search.uphill == 0)) {
      if (!search.go_on_or_back(settled)) break;
      continue;
    }
    search.accept(weights.estimated ? kIdleFall
                                    : std::max(kIdleFall, kFirstIdleShare * search.best.at.cost));
    costs.push_back(search.best.at.cost);
    if (!settled && search.idle < kIdleSteps) continue;
    Minimum found = minimum_at(search.best, std::move(costs));
    found.converged = true;
    found.message =
        fmt::format("last step {:.1e} standard deviations", step.in_standard_deviations);
    return found;
  }
  if (!std::isfinite(search.best.at.cost))
    return refused("calibration of batch {}: the solver failed", problem.batch.id);
  return minimum_at(search.best, std::move(costs));
}

}  // namespace trammel
