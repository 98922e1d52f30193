#include "server/diagnose/separability.h"

#include <algorithm>
#include <cmath>

#include "server/diagnose/candidates.h"
#include "server/diagnose/wording.h"

namespace trammel {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kPower = 1.2816;        // standard deviations: nine of ten
constexpr double kAbsorbedShare = 0.05;  // of an effect's length is left: nothing to go by
constexpr double kSameEffect = 0.95;     // canonical correlation
constexpr double kMarginStrength = 20;   // between a cause and its imitator, for one to be told from the other
constexpr double kLeastAlignment = 0.9;  // of an effect with one parameter, to say that it is that one

/// One direction of a family's effect, the one that stands out most; and how much of it does.
struct Direction {
  VectorXd effect;     // R, whitened, per prior
  VectorXd projected;  // S⁻¹ effect
  double strength = 0;
  double share = 0;
};

Direction clearest(const MatrixXd& columns, const Background& background) {
  const MatrixXd information = columns.transpose() * background.project(columns);
  const MatrixXd whole = columns.transpose() * columns + 1e-12 * MatrixXd::Identity(columns.cols(), columns.cols());
  const Eigen::GeneralizedSelfAdjointEigenSolver<MatrixXd> eigen(0.5 * (information + information.transpose()), whole);
  const Index last = columns.cols() - 1;
  Direction direction;
  direction.effect = columns * eigen.eigenvectors().col(last).normalized();
  direction.projected = background.project(direction.effect);
  direction.strength = direction.effect.dot(direction.projected);
  direction.share = std::sqrt(std::max(0.0, direction.strength) / std::max(1e-300, direction.effect.squaredNorm()));
  return direction;
}

/// The model's own parameter that an effect is most like, if any.
std::optional<Cause> absorbing(const LinearProblem& problem, const VectorXd& effect) {
  Index best = -1;
  double highest = kLeastAlignment;
  for (Index k = 0; k < problem.nuisance().cols(); ++k) {
    const VectorXd column = problem.nuisance().col(k);
    const double length = column.norm() * effect.norm();
    const double alignment = length > 0 ? std::abs(column.dot(effect)) / length : 0;
    if (alignment > highest) {
      highest = alignment;
      best = k;
    }
  }
  Index next = 0;
  for (const ErrorSourcePtr& source : problem.model().sources) {
    for (const Parameter& parameter : source->parameters()) {
      if (next++ != best) continue;
      Cause cause = cause_of(*source, problem.batch());
      cause.parameter = parameter.name;
      return cause;
    }
  }
  return std::nullopt;
}

bool is_group(const Cause& cause) { return cause.parameter.empty(); }

}  // namespace

Blindness blindness(const LinearProblem& problem, const std::vector<FamilyPtr>& families, const Background& background,
                    const Scan& seen) {
  Blindness result;
  std::vector<std::size_t> places;
  std::vector<Direction> directions;
  for (std::size_t f = 0; f < families.size(); ++f) {
    if (!families[f]->named() || !families[f]->predicts()) continue;
    const MatrixXd columns = families[f]->columns(families[f]->typical());
    if (columns.squaredNorm() == 0) continue;
    // What single numbers of a cause are absorbed by, one by one.
    const Cause cause = families[f]->cause(families[f]->typical());
    for (Index k = 0; k < columns.cols() && columns.cols() <= 6; ++k) {
      const VectorXd column = columns.col(k);
      const double left = column.dot(background.project(column).col(0));
      if (left > kAbsorbedShare * kAbsorbedShare * column.squaredNorm()) continue;
      if (const std::optional<Cause> absorber = absorbing(problem, column)) {
        const Inseparable pair{{cause, *absorber}, 1 - left / std::max(1e-300, column.squaredNorm())};
        if (std::none_of(result.inseparable.begin(), result.inseparable.end(),
                         [&](const Inseparable& other) { return other.causes == pair.causes; }))
          result.inseparable.push_back(pair);
      }
    }
    places.push_back(f);
    directions.push_back(clearest(columns, background));
  }

  for (std::size_t i = 0; i < places.size(); ++i) {
    const Direction& own = directions[i];
    const Cause cause = families[places[i]]->cause(families[places[i]]->typical());
    if (!is_group(cause)) continue;
    Unseen unseen{cause, own.share, {}, {}, ""};
    if (own.strength >= 1 && own.share > kAbsorbedShare) {
      double imitated = 0;
      for (std::size_t j = 0; j < places.size(); ++j) {
        const Cause other = families[places[j]]->cause(families[places[j]]->typical());
        if (i == j || other.cause == cause.cause || directions[j].strength < 1) continue;
        const double overlap = own.effect.dot(directions[j].projected);
        const double correlation = std::abs(overlap) / std::sqrt(own.strength * directions[j].strength);
        imitated = std::max(imitated, correlation);
        if (correlation > kSameEffect && j > i && is_group(other))
          result.inseparable.push_back({{cause, other}, correlation});
      }
      const double line = strength_for(seen.limit + seen.penalty[places[i]],
                                       seen.best[places[i]].freedom > 0 ? seen.best[places[i]].freedom : 1);
      const double needed = std::pow(std::sqrt(line) + kPower, 2);
      const double rms = problem.position_rms(own.effect);
      unseen.detectable = rms * std::sqrt(needed / own.strength);
      const double distinct = 1 - imitated * imitated;
      if (imitated < kSameEffect)
        unseen.identifiable = rms * std::sqrt(std::max(needed, kMarginStrength / distinct) / own.strength);
      else
        unseen.needs = what_it_needs(cause);
    } else {
      unseen.needs = what_it_needs(cause);
    }
    result.unseen.push_back(std::move(unseen));
  }
  return result;
}

}  // namespace trammel
