#include "server/diagnose/refine.h"

#include <algorithm>

#include "server/diagnose/effect.h"
#include "server/diagnose/product.h"

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
    const VectorXd step = information.llt().solve(right);
    left -= right.dot(step);
    for (Index i = 0; i < P; ++i) {
      const Parameter& prior = prior_model.priors[static_cast<std::size_t>(i)];
      double& value = prior_model.model.values(i);
      value = std::max(value + prior.prior_scale * step(i), prior.lower);
    }
    const VectorXd own = step.head(P);
    if (own.dot(information.topLeftCorner(P, P) * own) < kSettled * kSettled) break;
  }
  return left;
}

}  // namespace trammel
