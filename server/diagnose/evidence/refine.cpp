#include "server/diagnose/evidence/refine.h"

#include <algorithm>
#include <vector>

#include "server/diagnose/evidence/effect.h"
#include "server/numerics/product.h"

namespace trammel {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kMostSteps = 5;
constexpr double kSettled = 0.05;  // standard deviations, together

/// How far each parameter stands from its prior, in units of it.
VectorXd from_prior(const PriorModel& at) {
  VectorXd distance(at.model.values.size());
  for (Index k = 0; k < distance.size(); ++k) {
    const Parameter& prior = at.priors[static_cast<std::size_t>(k)];
    distance(k) = (at.model.values(k) - prior.prior) / prior.prior_scale;
  }
  return distance;
}

/// The step that lowers the sum of squares most without leaving a parameter below its bound: what would go beyond stops
/// there, and everything else is solved for anew. Cutting a step off afterwards would leave the others where they were
/// to make up for what was cut.
VectorXd bounded_step(const PriorModel& at, const MatrixXd& information, const VectorXd& right) {
  VectorXd step = information.llt().solve(right);
  const Index P = at.model.values.size();
  std::vector<bool> held(static_cast<std::size_t>(right.size()), false);
  const auto room = [&](Index i) {
    const Parameter& prior = at.priors[static_cast<std::size_t>(i)];
    return (prior.lower - at.model.values(i)) / prior.prior_scale;
  };
  for (bool more = true; more;) {
    more = false;
    for (Index i = 0; i < P; ++i) {
      if (held[static_cast<std::size_t>(i)] || step(i) >= room(i)) continue;
      held[static_cast<std::size_t>(i)] = more = true;
    }
    if (!more) break;
    // What is held moves to its bound, at any price.
    MatrixXd left = information;
    VectorXd rest = right;
    for (Index i = 0; i < P; ++i) {
      if (!held[static_cast<std::size_t>(i)]) continue;
      rest -= room(i) * information.col(i);
      left.row(i).setZero();
      left.col(i).setZero();
      left(i, i) = 1;
    }
    for (Index i = 0; i < P; ++i) {
      if (held[static_cast<std::size_t>(i)]) rest(i) = room(i);
    }
    step = left.llt().solve(rest);
  }
  return step;
}

}  // namespace

MatrixXd background_columns(const LinearProblem& problem, const std::vector<Unnamed>& unnamed) {
  Index count = problem.nuisance().cols();
  for (const Unnamed& one : unnamed) count += one.columns.cols();
  MatrixXd columns(problem.rows(), count);
  columns.leftCols(problem.nuisance().cols()) = problem.nuisance();
  Index next = problem.nuisance().cols();
  for (const Unnamed& one : unnamed) {
    columns.middleCols(next, one.columns.cols()) = problem.weight().asDiagonal() * one.columns;
    next += one.columns.cols();
  }
  return columns;
}

Status add_to(PriorModel& prior_model, const std::string& spec) {
  Result<ErrorSourcePtr> source = make_error_source(spec, *prior_model.model.cell);
  if (!source) return tl::make_unexpected(source.error());
  const std::vector<Parameter> parameters = (*source)->parameters();
  const Index first = add_source(prior_model.model, std::move(*source));
  prior_model.priors.insert(prior_model.priors.begin() + first, parameters.begin(), parameters.end());
  return {};
}

void remove_from(PriorModel& prior_model, const std::string& source) {
  const std::vector<Index> places = places_of_source(prior_model.model, source);
  if (places.empty()) return;
  prior_model.priors.erase(prior_model.priors.begin() + places.front(), prior_model.priors.begin() + places.back() + 1);
  prior_model.model = without_source(prior_model.model, source);
}

double refine(PriorModel& prior_model, const MeasurementBatch& batch, const std::vector<Unnamed>& unnamed) {
  double left = 0;
  for (int k = 0; k < kMostSteps; ++k) {
    const LinearProblem problem(prior_model.model, batch, prior_model.priors, {});
    const MatrixXd columns = background_columns(problem, unnamed);
    const Index P = problem.nuisance().cols();
    MatrixXd information = transposed_product(columns, columns);
    VectorXd right = columns.transpose() * problem.residual();
    const VectorXd distance = from_prior(prior_model);
    left = problem.residual().squaredNorm() + distance.squaredNorm();
    right.head(P) -= distance;
    information.diagonal().array() += 1;
    const VectorXd step = bounded_step(prior_model, information, right);
    left -= 2 * right.dot(step) - step.dot(information * step);
    for (Index i = 0; i < P; ++i) {
      const Parameter& prior = prior_model.priors[static_cast<std::size_t>(i)];
      double& value = prior_model.model.values(i);
      value = std::max(value + prior.prior_scale * step(i), prior.lower);  // rounding
    }
    const VectorXd own = step.head(P);
    if (own.dot(information.topLeftCorner(P, P) * own) < kSettled * kSettled) break;
  }
  return left;
}

}  // namespace trammel
