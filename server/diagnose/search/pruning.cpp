#include "server/diagnose/search/pruning.h"

#include <algorithm>

#include "server/diagnose/evidence/background.h"
#include "server/diagnose/evidence/effect.h"

namespace trammel::cause_search {

namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

LinearProblem problem_of(const SearchResult& result) {
  return {result.after.model, result.batch, result.after.priors, {}};
}

/// nat: log marginal likelihood of `columns` (R x m, per prior) against none of them, beside `rest`.
double evidence_of(const MatrixXd& columns, const Background& rest, const VectorXd& data) {
  const MatrixXd information =
      columns.transpose() * rest.project(columns) + MatrixXd::Identity(columns.cols(), columns.cols());
  const VectorXd right = columns.transpose() * rest.project(data);
  const Eigen::LLT<MatrixXd> factor(information);
  const double log_det = 2 * MatrixXd(factor.matrixL()).diagonal().array().log().sum();
  return 0.5 * (right.dot(factor.solve(right)) - log_det);
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
  return std::nullopt;
}

std::optional<std::size_t> weak_function(const SearchResult& result, double limit) {
  const LinearProblem problem = problem_of(result);
  for (std::size_t k = 0; k < result.unnamed.size(); ++k) {
    std::vector<Unnamed> others = result.unnamed;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(k));
    const Background rest(background_columns(problem, others));
    const MatrixXd columns = problem.weight().asDiagonal() * result.unnamed[k].columns;
    if (!(evidence_of(columns, rest, problem.residual()) >= limit)) return k;
  }
  return std::nullopt;
}

}  // namespace trammel::cause_search
