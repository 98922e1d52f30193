#include "server/diagnose/search/recovery.h"

#include <algorithm>
#include <cmath>

namespace trammel::cause_search {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index kRepetitions = 25;                             // of each size: a share is known to a tenth
constexpr double kStrengths[] = {5, 15, 30, 45, 60, 90, 150};  // hidden, from never named to always

}  // namespace

std::vector<Recovery> recovery_of(const LinearProblem& problem, const std::vector<FamilyPtr>& families,
                                  const Background& background, const Chance& chance,
                                  const std::vector<std::size_t>& places, std::uint64_t seed) {
  const auto sizes = static_cast<Index>(std::size(kStrengths));
  const MatrixXd noise = draw_null(background, kRepetitions, seed);
  std::vector<Recovery> all;
  for (const std::size_t place : places) {
    const Best typical = families[place]->typical();
    const MatrixXd columns = families[place]->columns(typical);
    // The same direction within the cause each time: that of equal shares of its priors.
    const VectorXd effect = columns.rowwise().sum();
    const double strength = effect.dot(background.project(effect).col(0));
    if (strength < 1) continue;
    Recovery recovery{families[place]->cause(typical), VectorXd(sizes), VectorXd::Zero(sizes)};
    MatrixXd hidden(problem.rows(), sizes * kRepetitions);
    for (Index k = 0; k < sizes; ++k) {
      const double size = std::sqrt(kStrengths[k] / strength);
      recovery.effect_rms(k) = size * problem.position_rms(effect);
      hidden.middleCols(k * kRepetitions, kRepetitions) = noise.colwise() + size * effect;
    }
    const Winners won = winners(families, background, hidden, chance);
    for (std::size_t d = 0; d < won.family.size(); ++d) {
      if (won.score[d] < chance.limit) continue;
      const Family& winner = *families[static_cast<std::size_t>(won.family[d])];
      const Cause cause = winner.cause(winner.typical());
      if (cause.cause == recovery.cause.cause && cause.joint == recovery.cause.joint)
        recovery.named(static_cast<Index>(d) / kRepetitions) += 1.0 / static_cast<double>(kRepetitions);
    }
    all.push_back(std::move(recovery));
  }
  return all;
}

}  // namespace trammel::cause_search
