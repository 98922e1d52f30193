#include "server/diagnose/evidence/refine.h"

#include <algorithm>
#include <vector>

#include "server/diagnose/evidence/effect.h"
#include "server/numerics/product.h"

namespace trammel::cause_search {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kMostSteps = 5;      // of Gauss and Newton; three settle what is nearly linear
constexpr double kSettled = 0.05;  // standard deviations, of all parameters together: a step that changes no result

/// How far each parameter stands from its prior, in units of it.
VectorXd from_prior(const PriorModel& at) {
  VectorXd distance(at.model.values.size());
  for (Index k = 0; k < distance.size(); ++k) {
    const Parameter& prior = at.priors[static_cast<std::size_t>(k)];
    distance(k) = (at.model.values(k) - prior.prior) / prior.prior_scale;
  }
  return distance;
}

/// A normal equation: information * step = right. The model's parameters come first.
struct NormalEquation {
  MatrixXd information;
  VectorXd right;
};

/// The step that lowers the sum of squares most and takes every parameter that is `held` to its bound: `room` from
/// where it stands, at any price.
VectorXd step_to_bounds(const NormalEquation& equation, const std::vector<bool>& held, const VectorXd& room) {
  MatrixXd left = equation.information;
  VectorXd rest = equation.right;
  for (Index i = 0; i < room.size(); ++i) {
    if (!held[static_cast<std::size_t>(i)]) continue;
    rest -= room(i) * equation.information.col(i);
    left.row(i).setZero();
    left.col(i).setZero();
    left(i, i) = 1;
  }
  for (Index i = 0; i < room.size(); ++i) {
    if (held[static_cast<std::size_t>(i)]) rest(i) = room(i);
  }
  return left.llt().solve(rest);
}

/// How far each parameter is above its lower bound, in units of its prior and with a minus sign.
VectorXd room_of(const PriorModel& at) {
  VectorXd room(at.model.values.size());
  for (Index i = 0; i < room.size(); ++i) {
    const Parameter& prior = at.priors[static_cast<std::size_t>(i)];
    room(i) = (prior.lower - at.model.values(i)) / prior.prior_scale;
  }
  return room;
}

/// The step that lowers the sum of squares most without leaving a parameter below its bound. What would go beyond stops
/// there, and everything else is solved for anew: a step that is cut off afterwards leaves the others where they made
/// up for what was cut.
VectorXd bounded_step(const PriorModel& at, const NormalEquation& equation) {
  VectorXd step = equation.information.llt().solve(equation.right);
  const VectorXd room = room_of(at);
  std::vector<bool> held(static_cast<std::size_t>(room.size()), false);
  while (true) {
    bool more = false;
    for (Index i = 0; i < room.size(); ++i) {
      if (held[static_cast<std::size_t>(i)] || step(i) >= room(i)) continue;
      held[static_cast<std::size_t>(i)] = more = true;
    }
    if (!more) return step;
    step = step_to_bounds(equation, held, room);
  }
}

/// About where the model stands. `columns`: of the whole background; the priors pull by `distance` from them.
NormalEquation normal_equation(const LinearProblem& problem, const MatrixXd& columns, const VectorXd& distance) {
  NormalEquation equation{transposed_product(columns, columns), columns.transpose() * problem.residual()};
  equation.right.head(distance.size()) -= distance;
  equation.information.diagonal().array() += 1;
  return equation;
}

/// Moves the model by `step`, in units of priors.
void move(PriorModel& at, const VectorXd& step) {
  for (Index i = 0; i < at.model.values.size(); ++i) {
    const Parameter& prior = at.priors[static_cast<std::size_t>(i)];
    double& value = at.model.values(i);
    value = std::max(value + prior.prior_scale * step(i), prior.lower);  // rounding
  }
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
    const VectorXd distance = from_prior(prior_model);
    const NormalEquation equation = normal_equation(problem, background_columns(problem, unnamed), distance);
    const VectorXd step = bounded_step(prior_model, equation);
    left = problem.residual().squaredNorm() + distance.squaredNorm();
    left -= 2 * equation.right.dot(step) - step.dot(equation.information * step);
    move(prior_model, step);
    const Index P = distance.size();
    const VectorXd own = step.head(P);
    if (own.dot(equation.information.topLeftCorner(P, P) * own) < kSettled * kSettled) break;
  }
  return left;
}

}  // namespace trammel::cause_search
