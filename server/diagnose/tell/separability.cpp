#include "server/diagnose/tell/separability.h"

#include <algorithm>
#include <cmath>

#include "server/diagnose/families/candidates.h"
#include "server/diagnose/search/naming.h"
#include "server/diagnose/tell/wording.h"
#include "server/diagnose/thresholds.h"
#include "server/numerics/product.h"

namespace trammel::cause_search {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index kMostSingles =
    8;  // parameters of a cause that are tested one by one; a map has a hundred

/// A family's effect, on average over the sizes that its priors allow.
struct Average {
  MatrixXd columns;     // R x m, whitened, per prior
  MatrixXd projected;   // R x m: their part outside the background
  MatrixXd inverse;     // m x m: L⁻¹ of their information beside the background, priors included
  double strength = 0;  // the part of its strength that stands out
  double share = 0;     // of its length
  double rms = 0;       // m
};

Average average_of(const LinearProblem& problem, const MatrixXd& columns,
                   const Background& background) {
  Average average{columns, background.project(columns), {}, 0, 0, 0};
  MatrixXd information = transposed_product(average.columns, average.projected);
  average.strength = std::max(0.0, information.trace());
  information.diagonal().array() += 1;
  average.inverse = inverse_factor_of(information);
  average.share = std::sqrt(average.strength / std::max(1e-300, columns.squaredNorm()));
  for (Index k = 0; k < columns.cols(); ++k)
    average.rms = std::hypot(average.rms, problem.position_rms(columns.col(k)));
  return average;
}

/// The share of one family's effect that, on average, another makes as well: a correlation.
double imitation(const Average& own, const Average& other) {
  const MatrixXd shared = transposed_product(other.columns, own.projected);
  return std::sqrt(std::clamp((other.inverse * shared).squaredNorm() / own.strength, 0.0, 1.0));
}

/// The model's own parameter that an effect is most like, if any.
std::optional<Cause> absorbing(const LinearProblem& problem, const VectorXd& effect) {
  Index best = -1;
  double highest = thresholds::kLikeOneParameter;
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

/// Once a pair, in whichever order it is met.
void add_pair(std::vector<Inseparable>& pairs, const Cause& one, const Cause& other,
              double correlation) {
  for (Inseparable& known : pairs) {
    const auto& causes = known.causes;
    if (causes != std::vector<Cause>{one, other} && causes != std::vector<Cause>{other, one})
      continue;
    known.correlation = std::max(known.correlation, correlation);
    return;
  }
  pairs.push_back({{one, other}, correlation});
}

/// Single numbers of a cause that the model's own parameters take over whole.
void add_absorbed(const LinearProblem& problem, const Background& background,
                  const MatrixXd& columns, const Cause& cause,
                  std::vector<Inseparable>& inseparable) {
  if (columns.cols() > kMostSingles) return;
  for (Index k = 0; k < columns.cols(); ++k) {
    const VectorXd column = columns.col(k);
    const double whole = std::max(1e-300, column.squaredNorm());
    const double left = column.dot(background.project(column).col(0)) / whole;
    if (left > thresholds::kAbsorbed * thresholds::kAbsorbed) continue;
    const std::optional<Cause> absorber = absorbing(problem, column);
    if (absorber)
      add_pair(inseparable, cause, *absorber, std::sqrt(1 - std::clamp(left, 0.0, 1.0)));
  }
}

}  // namespace

Blindness blindness(const LinearProblem& problem, const std::vector<FamilyPtr>& families,
                    const Background& background, const Chance& chance) {
  Blindness result;
  std::vector<std::size_t> places;
  std::vector<Average> averages;
  for (std::size_t f = 0; f < families.size(); ++f) {
    const Cause cause = families[f]->cause(families[f]->typical());
    if (!families[f]->named() || !families[f]->predicts() || !cause.parameter.empty()) continue;
    const MatrixXd columns = families[f]->columns(families[f]->typical());
    if (columns.squaredNorm() == 0) continue;
    add_absorbed(problem, background, columns, cause, result.inseparable);
    places.push_back(f);
    averages.push_back(average_of(problem, columns, background));
  }
  for (std::size_t i = 0; i < places.size(); ++i) {
    const Average& own = averages[i];
    const Cause cause = families[places[i]]->cause(families[places[i]]->typical());
    Unseen unseen{cause, own.share, {}, {}, ""};
    if (own.strength < 1 || own.share < thresholds::kAbsorbed) {
      unseen.needs = what_it_needs(cause);
      result.unseen.push_back(std::move(unseen));
      continue;
    }
    double imitated = 0;
    for (std::size_t j = 0; j < places.size(); ++j) {
      const Cause other = families[places[j]]->cause(families[places[j]]->typical());
      if (i == j || averages[j].strength < 1 || is_description_of(other, cause)) continue;
      const double correlation = imitation(own, averages[j]);
      imitated = std::max(imitated, correlation);
      if (correlation > thresholds::kSameEffect)
        add_pair(result.inseparable, cause, other, correlation);
    }
    const int freedom = std::max(1, families[places[i]]->typical().freedom);
    const double needed = std::pow(
        std::sqrt(strength_for(chance.limit + chance.penalty_of(*families[places[i]]), freedom)) +
            thresholds::kPower,
        2);
    const auto size_for = [&](double strength) {
      return own.rms * std::sqrt(strength / own.strength);
    };
    unseen.size_of_unit = size_for(1);
    unseen.detectable = size_for(needed);
    if (imitated < thresholds::kSameEffect)
      unseen.identifiable =
          size_for(std::max(needed, thresholds::kToldApart / (1 - imitated * imitated)));
    else
      unseen.needs = what_it_needs(cause);
    const bool partly =
        std::any_of(result.inseparable.begin(), result.inseparable.end(),
                    [&](const Inseparable& pair) { return pair.causes.front() == cause; }) ||
        imitated > thresholds::kSameEffect;
    if (partly && unseen.needs.empty()) unseen.needs = what_it_needs(cause);
    result.unseen.push_back(std::move(unseen));
  }
  return result;
}

}  // namespace trammel::cause_search
