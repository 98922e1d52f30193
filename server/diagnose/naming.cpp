#include "server/diagnose/naming.h"

#include <algorithm>

namespace trammel {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index kRepetitions = 100;
constexpr double kSureFrequency = 0.9;
constexpr double kRivalFrequency = 0.03;
constexpr double kMargin = 3;           // nat: odds of 20 to 1
constexpr double kSameEffect = 0.9025;  // square of the canonical correlation 0.95
constexpr double kAsGood = 6;           // of strength
constexpr double kShapeError = 0.02;    // of strength: real causes are not quite shaped like their models

/// The same cause, told by one number or by all; or a more general description of one joint's angle error.
bool no_rival(const Cause& named, const Cause& other) {
  if (named.cause == other.cause) return named.joint == other.joint || named.joint < 0 || other.joint < 0;
  const bool angle = named.cause == "gear_transmission" || named.cause == "encoder_eccentricity";
  return angle && other.cause == "joint_map" && named.joint == other.joint;
}

VectorXd fitted(const Background& background, const MatrixXd& columns, const VectorXd& data) {
  const MatrixXd information =
      columns.transpose() * background.project(columns) + MatrixXd::Identity(columns.cols(), columns.cols());
  return columns * information.llt().solve(columns.transpose() * background.project(data));
}

/// Which family wins in each repetition.
std::vector<std::size_t> winners(const std::vector<FamilyPtr>& families, const Background& background,
                                 const MatrixXd& repeated, const Scan& seen) {
  const MatrixXd projected = background.project(repeated);
  std::vector<std::size_t> winner(static_cast<std::size_t>(repeated.cols()), 0);
  std::vector<double> highest(winner.size(), 0);
  for (std::size_t f = 0; f < families.size(); ++f) {
    const std::vector<Best> best = families[f]->scan({background}, projected);
    for (std::size_t d = 0; d < best.size(); ++d) {
      const double score = best[d].evidence - seen.penalty[f];
      if (score <= highest[d]) continue;
      highest[d] = score;
      winner[d] = f;
    }
  }
  return winner;
}

}  // namespace

Naming name_or_doubt(const std::vector<FamilyPtr>& families, const Background& background, const MatrixXd& null,
                     const VectorXd& data, const Scan& seen, std::size_t place) {
  const Best& best = seen.best[place];
  const Cause cause = families[place]->cause(best);
  const VectorXd effect = fitted(background, families[place]->columns(best), data);
  const MatrixXd repeated = null.leftCols(std::min(kRepetitions, null.cols())).colwise() + effect;
  const std::vector<std::size_t> winner = winners(families, background, repeated, seen);
  const auto share_of = [&](std::size_t f) {
    return static_cast<double>(std::count(winner.begin(), winner.end(), f)) / static_cast<double>(winner.size());
  };
  const MatrixXd projected = background.project(effect);
  const double whole = effect.dot(projected.col(0));

  Naming naming{0, {}};
  for (std::size_t f = 0; f < families.size(); ++f) {
    if (families[f]->named() && (f == place || no_rival(cause, families[f]->cause(seen.best[f]))))
      naming.frequency += share_of(f);
  }
  for (std::size_t f = 0; f < families.size(); ++f) {
    if (!families[f]->named() || !families[f]->predicts() || seen.best[f].evidence <= 0) continue;
    const Cause other = families[f]->cause(seen.best[f]);
    if (f == place || no_rival(cause, other)) continue;
    const Best of_effect = families[f]->scan({background}, projected).front();
    const bool same_effect = of_effect.strength > kSameEffect * whole;
    const double lacks = (best.strength - best.freedom) - (seen.best[f].strength - seen.best[f].freedom);
    const bool as_good = same_effect && lacks < std::max(kAsGood, kShapeError * best.strength);
    const bool as_likely = seen.score(place) - seen.score(f) < kMargin;
    const bool wins = naming.frequency < kSureFrequency && share_of(f) > kRivalFrequency;
    if (as_good || as_likely || wins) naming.could_also_be.push_back(other);
  }
  return naming;
}

}  // namespace trammel
