#include "server/diagnose/search/recovery.h"

#include <algorithm>
#include <cmath>

namespace trammel::cause_search {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index kRepetitionsOfASize = 25;  // of each size: a share is known to a tenth
constexpr double kStrengths[] = {5, 15, 30, 45, 60, 90, 150};  // hidden, from never named to always

/// A family's effect at every size, in noise: R x (sizes * kRepetitionsOfASize).
struct Hidden {
  Recovery recovery;  ///< sizes, nothing named yet
  MatrixXd data;
};

/// The direction within the cause has equal shares of its priors. Empty if the effect is not
/// visible above the background.
std::optional<Hidden> hidden_in(const MatrixXd& noise, const LinearProblem& problem,
                                const Family& family, const Background& background) {
  const Best typical = family.typical();
  const VectorXd effect = family.columns(typical).rowwise().sum();
  const double strength = effect.dot(background.project(effect).col(0));
  if (strength < 1) return std::nullopt;
  const auto sizes = static_cast<Index>(std::size(kStrengths));
  Hidden hidden{{family.cause(typical), VectorXd(sizes), VectorXd::Zero(sizes)},
                MatrixXd(problem.rows(), sizes * kRepetitionsOfASize)};
  for (Index k = 0; k < sizes; ++k) {
    const double size = std::sqrt(kStrengths[k] / strength);
    hidden.recovery.effect_rms(k) = size * problem.position_rms(effect);
    hidden.data.middleCols(k * kRepetitionsOfASize, kRepetitionsOfASize) =
        noise.colwise() + size * effect;
  }
  return hidden;
}

/// Adds to `recovery` how often its cause won a column, and passed the line.
void count_named(const Winners& won, const std::vector<FamilyPtr>& families, double limit,
                 Recovery& recovery) {
  for (std::size_t d = 0; d < won.family.size(); ++d) {
    if (won.score[d] < limit) continue;
    const Family& winner = *families[static_cast<std::size_t>(won.family[d])];
    const Cause cause = winner.cause(winner.typical());
    if (cause.cause == recovery.cause.cause && cause.joint == recovery.cause.joint)
      recovery.named(static_cast<Index>(d) / kRepetitionsOfASize) +=
          1.0 / static_cast<double>(kRepetitionsOfASize);
  }
}

}  // namespace

std::vector<Recovery> recovery_of(const LinearProblem& problem,
                                  const std::vector<FamilyPtr>& families,
                                  const Background& background, const Chance& chance,
                                  const std::vector<std::size_t>& places, std::uint64_t seed) {
  const MatrixXd noise = draw_null(background, kRepetitionsOfASize, seed);
  std::vector<Recovery> all;
  for (const std::size_t place : places) {
    std::optional<Hidden> hidden = hidden_in(noise, problem, *families[place], background);
    if (!hidden) continue;
    count_named(winners(families, background, hidden->data, chance), families, chance.limit,
                hidden->recovery);
    all.push_back(std::move(hidden->recovery));
  }
  return all;
}

}  // namespace trammel::cause_search
