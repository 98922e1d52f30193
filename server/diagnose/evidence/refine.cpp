#include "server/diagnose/evidence/refine.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "server/diagnose/evidence/background.h"
#include "server/diagnose/evidence/effect.h"
#include "server/numerics/product.h"

namespace trammel::cause_search {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kMostSteps = 5;   // of Gauss-Newton; one and a chord are enough for a nearly linear
                                // problem
constexpr int kMostChords = 4;  // steps by one derivative
constexpr double kStraight =
    1;  // standard deviations, of all rows together: the tolerated error of a derivative
constexpr double kSettled =
    0.05;  // standard deviations, of all parameters together: a step that changes no result

/// The distance of each parameter from its prior, in prior units.
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
  MatrixXd inverse_factor;  // L⁻¹ of the information L Lᵀ
  VectorXd right;
};

/// The step that lowers the sum of squares most and moves every `held` parameter exactly to its
/// bound, which is `room` away.
VectorXd step_to_bounds(const NormalEquation& equation, const std::vector<bool>& held,
                        const VectorXd& room) {
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

/// The distance of each parameter above its lower bound, in units of its prior and with a minus
/// sign.
VectorXd room_of(const PriorModel& at) {
  VectorXd room(at.model.values.size());
  for (Index i = 0; i < room.size(); ++i) {
    const Parameter& prior = at.priors[static_cast<std::size_t>(i)];
    room(i) = (prior.lower - at.model.values(i)) / prior.prior_scale;
  }
  return room;
}

/// The step that lowers the sum of squares most without any parameter below its bound. Parameters
/// that would go beyond stop at the bound, and all others are solved anew. Cutting the step
/// afterwards would leave the others compensating for the part that was cut.
VectorXd bounded_step(const PriorModel& at, const NormalEquation& equation) {
  VectorXd step = equation.inverse_factor.transpose() * (equation.inverse_factor * equation.right);
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

/// `columns`: of the whole background.
NormalEquation normal_equation(const MatrixXd& columns) {
  MatrixXd information = gram(columns);
  information.diagonal().array() += 1;
  MatrixXd inverse = inverse_factor_of(information);
  return {std::move(information), std::move(inverse), {}};
}

/// The pull where the model stands: `left` (R, whitened) of the data and, of the model's own
/// parameters, their priors. The anonymous functions stand at `functions` times their columns.
VectorXd pull(const MatrixXd& columns, const VectorXd& left, const PriorModel& at,
              const VectorXd& functions) {
  const Index P = at.model.values.size();
  VectorXd right = columns.transpose() * (left - columns.rightCols(functions.size()) * functions);
  right.head(P) -= from_prior(at);
  right.tail(functions.size()) -= functions;
  return right;
}

/// True if the model's own `step` changes no result.
bool is_settled(const NormalEquation& equation, const VectorXd& step) {
  const Index P = step.size();
  return step.dot(equation.information.topLeftCorner(P, P) * step) < kSettled * kSettled;
}

/// Moves the model by `step`, in units of priors.
void move(PriorModel& at, const VectorXd& step) {
  for (Index i = 0; i < step.size(); ++i) {
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
  ErrorSourcePtr source = TRY(make_error_source(spec, *prior_model.model.cell));
  const std::vector<Parameter> parameters = source->parameters();
  const Index first = add_source(prior_model.model, std::move(source));
  prior_model.priors.insert(prior_model.priors.begin() + first, parameters.begin(),
                            parameters.end());
  return {};
}

void remove_from(PriorModel& prior_model, const std::string& source) {
  const std::vector<Index> places = places_of_source(prior_model.model, source);
  if (places.empty()) return;
  prior_model.priors.erase(prior_model.priors.begin() + places.front(),
                           prior_model.priors.begin() + places.back() + 1);
  prior_model.model = without_source(prior_model.model, source);
}

void refine(PriorModel& prior_model, const MeasurementBatch& batch,
            const std::vector<Unnamed>& unnamed, Weighed weighed) {
  const Index P = prior_model.model.values.size();
  for (int k = 0; k < kMostSteps; ++k) {
    const LinearProblem problem(prior_model.model, batch, prior_model.priors, {}, weighed);
    const MatrixXd columns = background_columns(problem, unnamed);
    NormalEquation equation = normal_equation(columns);
    VectorXd functions = VectorXd::Zero(columns.cols() - P);
    VectorXd left = problem.residual();
    for (int chord = 0; chord < kMostChords; ++chord) {
      equation.right = pull(columns, left, prior_model, functions);
      const VectorXd step = bounded_step(prior_model, equation);
      move(prior_model, step.head(P));
      functions += step.tail(functions.size());
      if (is_settled(equation, step.head(P))) return;
      const VectorXd expected = left - columns.leftCols(P) * step.head(P);
      left = problem.residual_of(prior_model.model);
      if ((left - expected).norm() > kStraight) break;
    }
  }
}

}  // namespace trammel::cause_search
