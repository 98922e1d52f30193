#include "server/diagnose/search/pruning.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "server/diagnose/evidence/background.h"
#include "server/diagnose/evidence/effect.h"
#include "server/diagnose/search/folds.h"
#include "server/diagnose/thresholds.h"

namespace trammel::cause_search {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

LinearProblem problem_of(const SearchResult& result) {
  return {result.after.model, result.batch, result.after.priors, {}};
}

/// nat: log marginal likelihood of `columns` (R x m, per prior) relative to none, beside `rest`.
double evidence_of(const MatrixXd& columns, const Background& rest, const VectorXd& data) {
  const MatrixXd information = columns.transpose() * rest.project(columns) +
                               MatrixXd::Identity(columns.cols(), columns.cols());
  const VectorXd right = columns.transpose() * rest.project(data);
  const Eigen::LLT<MatrixXd> factor(information);
  const double log_det = 2 * MatrixXd(factor.matrixL()).diagonal().array().log().sum();
  return 0.5 * (right.dot(factor.solve(right)) - log_det);
}

/// The reduction of the squares of held-out poses by a cause.
struct Gain {
  double gain = 0, without = 0;  // sums over the poses
  double chance = 0;             // one standard deviation of the gain
  [[nodiscard]] bool is_none() const { return gain < thresholds::kLeastGain * without; }
  [[nodiscard]] bool is_by_chance() const { return gain < thresholds::kGainBeyondChance * chance; }
};

Gain gain_of(const LinearProblem& problem, const VectorXd& with, const VectorXd& without) {
  Gain all;
  double square = 0;
  for (Index i = 0; i < problem.poses(); ++i) {
    const Index row = problem.first_row(i);
    const Index count = problem.row_count(i);
    const double before = without.segment(row, count).squaredNorm();
    const double gain = before - with.segment(row, count).squaredNorm();
    all.gain += gain;
    all.without += before;
    square += gain * gain;
  }
  all.chance = std::sqrt(square);
  return all;
}

std::vector<Index> all_but(Index count, const std::vector<Index>& left_out) {
  std::vector<Index> kept;
  for (Index k = 0; k < count; ++k) {
    if (std::find(left_out.begin(), left_out.end(), k) == left_out.end()) kept.push_back(k);
  }
  return kept;
}

/// The first cause that always acts and does not improve the prediction of held-out poses. Causes
/// that begin at a pose are skipped, since they may act at few of them.
std::optional<std::size_t> idle_cause(const SearchResult& result, const LinearProblem& problem,
                                      double limit) {
  const MatrixXd columns = background_columns(problem, result.unnamed);
  const Folds folds(problem, columns);
  const VectorXd with = folds.held_out_residual(problem.residual());
  for (std::size_t k = 0; k < result.accepted.size(); ++k) {
    const Accepted& one = result.accepted[k];
    if (one.is_outlier() || record_of(one.cause).lasting != causes::Lasting::kAlways) continue;
    const std::vector<Index> others =
        all_but(columns.cols(), places_of_source(problem.model(), one.in_model));
    const VectorXd whole = problem.residual() + effect_of_source(problem, one.in_model);
    const Gain gain = gain_of(problem, with, folds.held_out_residual(whole, others));
    const bool beyond_chance =
        one.best.evidence > thresholds::kBeyondFolds * limit || !gain.is_by_chance();
    if (gain.is_none() || !beyond_chance) return k;
  }
  return std::nullopt;
}

}  // namespace

std::optional<std::size_t> weak_cause(const SearchResult& result, double limit) {
  const LinearProblem problem = problem_of(result);
  const Background all(background_columns(problem, result.unnamed));
  const VectorXd change = all.estimate(problem.residual());
  const MatrixXd covariance = all.covariance();
  for (std::size_t k = 0; k < result.accepted.size(); ++k) {
    const Accepted& one = result.accepted[k];
    if (one.is_outlier()) continue;
    const OwnEstimate own = own_estimate(problem, one.in_model, change, covariance);
    const double freedom = std::min<double>(one.best.freedom, static_cast<double>(own.size.size()));
    if (!(log_evidence(own.strength(), freedom) - one.penalty >= limit)) return k;
  }
  return idle_cause(result, problem, limit);
}

std::optional<std::size_t> weak_function(const SearchResult& result, double limit) {
  if (result.unnamed.empty()) return std::nullopt;
  const LinearProblem problem = problem_of(result);
  const Background all(background_columns(problem, result.unnamed));
  Index first = problem.nuisance().cols();
  for (std::size_t k = 0; k < result.unnamed.size(); ++k) {
    std::vector<Index> own(static_cast<std::size_t>(result.unnamed[k].columns.cols()));
    std::iota(own.begin(), own.end(), first);
    first += std::ssize(own);
    const Background rest = all.part(all_but(all.columns().cols(), own));
    if (!(evidence_of(all.columns()(Eigen::all, own), rest, problem.residual()) >= limit)) return k;
  }
  return std::nullopt;
}

}  // namespace trammel::cause_search
