#include "server/diagnose/recovery.h"

#include <algorithm>
#include <cmath>

namespace trammel {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index kRepetitions = 25;
constexpr double kStrengths[] = {5, 15, 30, 45, 60, 90, 150};

}  // namespace

std::vector<Recovery> recovery_of(const LinearProblem& problem, const std::vector<FamilyPtr>& families,
                                  const Background& background, const MatrixXd& null, const Scan& seen,
                                  const std::vector<std::size_t>& places) {
  const Index repetitions = std::min(kRepetitions, null.cols());
  const auto sizes = static_cast<Index>(std::size(kStrengths));
  std::vector<Recovery> all;
  for (const std::size_t place : places) {
    const Best typical = seen.best[place].evidence > 0 ? seen.best[place] : families[place]->typical();
    const MatrixXd columns = families[place]->columns(typical);
    if (columns.squaredNorm() == 0) continue;
    // The same direction within the cause each time: that of equal shares of its priors.
    const VectorXd effect = columns.rowwise().sum();
    const double strength = effect.dot(background.project(effect).col(0));
    if (strength < 1) continue;
    Recovery recovery{families[place]->cause(typical), VectorXd(sizes), VectorXd::Zero(sizes)};
    MatrixXd hidden(problem.rows(), sizes * repetitions);
    for (Index k = 0; k < sizes; ++k) {
      const double size = std::sqrt(kStrengths[k] / strength);
      recovery.effect_rms(k) = size * problem.position_rms(effect);
      hidden.middleCols(k * repetitions, repetitions) = null.leftCols(repetitions).colwise() + size * effect;
    }
    const MatrixXd projected = background.project(hidden);
    std::vector<double> highest(static_cast<std::size_t>(hidden.cols()), seen.limit);
    std::vector<bool> right(highest.size(), false);
    for (std::size_t f = 0; f < families.size(); ++f) {
      const std::vector<Best> best = families[f]->scan({background}, projected);
      const bool same = families[f]->cause(best.front()).cause == recovery.cause.cause &&
                        families[f]->cause(best.front()).joint == recovery.cause.joint;
      for (std::size_t d = 0; d < best.size(); ++d) {
        const double score = best[d].evidence - seen.penalty[f];
        if (score <= highest[d]) continue;
        highest[d] = score;
        right[d] = same;
      }
    }
    for (std::size_t d = 0; d < right.size(); ++d) {
      if (right[d]) recovery.named(static_cast<Index>(d) / repetitions) += 1.0 / static_cast<double>(repetitions);
    }
    all.push_back(std::move(recovery));
  }
  return all;
}

}  // namespace trammel
