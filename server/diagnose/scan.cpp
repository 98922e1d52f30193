#include "server/diagnose/scan.h"

#include <algorithm>
#include <cmath>
#include <random>

namespace trammel {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kTail = 0.1;  // share of the draws that its tail is fitted to
constexpr double kChance = 0.01;

double quantile(const VectorXd& ascending, double share) {
  const double place = share * static_cast<double>(ascending.size() - 1);
  const auto below = static_cast<Index>(place);
  const Index above = std::min(below + 1, ascending.size() - 1);
  return ascending(below) + (place - static_cast<double>(below)) * (ascending(above) - ascending(below));
}

/// Above the threshold the draws fall off exponentially: where that begins and how fast.
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

double Scan::p_value(double score) const {
  const Tail tail = tail_of(null_score);
  if (score > tail.threshold) return kTail * std::exp(-(score - tail.threshold) / tail.scale);
  const auto above = std::count_if(null_score.begin(), null_score.end(), [&](double s) { return s >= score; });
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

Scan scan(const std::vector<FamilyPtr>& families, const Background& background, const VectorXd& data,
          const MatrixXd& null) {
  const View view{background};
  const MatrixXd projected = background.project(data);
  const MatrixXd projected_null = background.project(null);
  Scan result;
  result.null_score = VectorXd::Zero(null.cols());
  std::vector<double> chance(static_cast<std::size_t>(null.cols()));
  for (const FamilyPtr& family : families) {
    result.best.push_back(family->scan(view, projected).front());
    const std::vector<Best> drawn = family->scan(view, projected_null);
    std::transform(drawn.begin(), drawn.end(), chance.begin(), [](const Best& one) { return one.evidence; });
    std::vector<double> sorted = chance;
    std::nth_element(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2), sorted.end());
    const double median = sorted.empty() ? 0 : sorted[sorted.size() / 2];
    result.penalty.push_back(median + family->surprise());
    for (std::size_t d = 0; d < chance.size(); ++d) {
      double& highest = result.null_score(static_cast<Index>(d));
      highest = std::max(highest, chance[d] - result.penalty.back());
    }
  }
  std::sort(result.null_score.begin(), result.null_score.end());
  const Tail tail = tail_of(result.null_score);
  result.limit = tail.threshold + tail.scale * std::log(kTail / kChance);
  return result;
}

}  // namespace trammel
