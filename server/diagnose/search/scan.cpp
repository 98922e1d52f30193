#include "server/diagnose/search/scan.h"

#include <algorithm>
#include <cmath>
#include <random>

#include "server/diagnose/thresholds.h"

namespace trammel::cause_search {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kTail =
    0.1;  // share of the draws that the tail is fitted to: 40 of 400 give its fall to a sixth

double quantile(const VectorXd& ascending, double share) {
  const double place = share * static_cast<double>(ascending.size() - 1);
  const auto below = static_cast<Index>(place);
  const Index above = std::min(below + 1, ascending.size() - 1);
  return ascending(below) +
         (place - static_cast<double>(below)) * (ascending(above) - ascending(below));
}

/// The draws above `threshold` fall off exponentially; `scale` is their mean excess.
struct Tail {
  double threshold, scale;
};
Tail tail_of(const VectorXd& ascending) {
  const double threshold = quantile(ascending, 1 - kTail);
  double sum = 0;
  Index count = 0;
  for (Index k = 0; k < ascending.size(); ++k) {
    if (ascending(k) <= threshold) continue;
    sum += ascending(k) - threshold;
    ++count;
  }
  return {threshold, count > 0 ? sum / static_cast<double>(count) : 1.0};
}

}  // namespace

double Chance::penalty_of(const Family& family) const {
  const auto known = penalty.find(family.label());
  return known == penalty.end() ? family.surprise() : known->second;
}

double Chance::limit_at(double share) const {
  const Tail tail = tail_of(null_score);
  return tail.threshold + tail.scale * std::log(kTail / share);
}

double Chance::p_value(double score) const {
  const Tail tail = tail_of(null_score);
  if (score > tail.threshold)
    return std::max(kLeastPValue, kTail * std::exp(-(score - tail.threshold) / tail.scale));
  const auto above =
      std::count_if(null_score.begin(), null_score.end(), [&](double s) { return s >= score; });
  return static_cast<double>(above + 1) / static_cast<double>(null_score.size() + 1);
}

MatrixXd draw_null(const Background& background, Index draws, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  MatrixXd white(background.columns().rows(), draws);
  MatrixXd numbers(background.columns().cols(), draws);
  for (double& value : white.reshaped()) value = normal(random);
  for (double& value : numbers.reshaped()) value = normal(random);
  return white + background.columns() * numbers;
}

Chance chance_of(const std::vector<FamilyPtr>& families, const Background& background, Index draws,
                 std::uint64_t seed) {
  Chance chance;
  const View view{background};
  const MatrixXd projected = background.project(draw_null(background, draws, seed));
  chance.null_score = VectorXd::Zero(draws);
  for (const FamilyPtr& family : families) {
    const std::vector<Best> drawn = family->scan(view, projected);
    std::vector<double> evidence(drawn.size());
    std::transform(drawn.begin(), drawn.end(), evidence.begin(),
                   [](const Best& one) { return one.evidence; });
    const auto middle = evidence.begin() + static_cast<std::ptrdiff_t>(evidence.size() / 2);
    std::nth_element(evidence.begin(), middle, evidence.end());
    const double penalty = *middle + family->surprise();
    chance.penalty[family->label()] = penalty;
    for (std::size_t d = 0; d < drawn.size(); ++d) {
      double& highest = chance.null_score(static_cast<Index>(d));
      highest = std::max(highest, drawn[d].evidence - penalty);
    }
  }
  std::sort(chance.null_score.begin(), chance.null_score.end());
  chance.limit = chance.limit_at(thresholds::kFalseAlarms);
  return chance;
}

Scan scan(const std::vector<FamilyPtr>& families, const View& view, const VectorXd& data,
          const Chance& chance, const std::function<bool(std::size_t)>& admitted) {
  const MatrixXd projected = view.background.project(
      view.keep == nullptr ? data : VectorXd(view.keep->cwiseProduct(data)));
  Scan result;
  for (std::size_t f = 0; f < families.size(); ++f) {
    result.best.push_back(admitted && !admitted(f) ? Best{}
                                                   : families[f]->scan(view, projected).front());
    result.score.push_back(result.best.back().evidence - chance.penalty_of(*families[f]));
  }
  return result;
}

Winners winners(const std::vector<FamilyPtr>& families, const Background& background,
                const MatrixXd& data, const Chance& chance,
                const std::function<bool(std::size_t)>& admitted) {
  const MatrixXd projected = background.project(data);
  Winners winners{std::vector<int>(static_cast<std::size_t>(data.cols()), -1), {}};
  winners.score.assign(winners.family.size(), 0);
  for (std::size_t f = 0; f < families.size(); ++f) {
    if (admitted && !admitted(f)) continue;
    const std::vector<Best> best = families[f]->scan({background}, projected);
    for (std::size_t d = 0; d < best.size(); ++d) {
      const double score = best[d].evidence - chance.penalty_of(*families[f]);
      if (score <= winners.score[d]) continue;
      winners.score[d] = score;
      winners.family[d] = static_cast<int>(f);
    }
  }
  return winners;
}

}  // namespace trammel::cause_search
