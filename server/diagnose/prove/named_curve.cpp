#include "server/diagnose/prove/named_curve.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "server/diagnose/diagnosis.h"

namespace trammel::cause_search {

namespace {

constexpr double kWeakestPutIn = 5;
constexpr double kCoverage = 0.95;
constexpr Eigen::Index kMiddles = 48;
constexpr double kWidths[] = {0.1, 0.2, 0.4, 0.8};  // of log strength
/// Possible shares for very strong effects. The last one is above kProvedShare. None is 0 or 1,
/// because a few diagnoses in a hundred differ for other reasons. Finer steps are useless: a
/// hundred diagnoses are needed to distinguish a share of 0.85 from one of 0.95.
constexpr double kMost[] = {0.005, 0.3, 0.6, 0.8, 0.97};

struct Curve {
  double middle = 0, width = 1, most = 1;

  [[nodiscard]] double named(double strength) const {
    return most / (1 + std::exp(-(std::log(strength) - middle) / width));
  }
  [[nodiscard]] std::optional<double> strength_at(double share) const {
    if (share >= most) return std::nullopt;
    const double of_most = share / most;
    const double strength = std::exp(middle + width * std::log(of_most / (1 - of_most)));
    if (strength > strength_put_in(kStrengthsPutIn - 1)) return std::nullopt;
    return strength;
  }
};

std::vector<Curve> grid_of_curves() {
  const double low = std::log(kWeakestPutIn);
  const double high = std::log(strength_put_in(kStrengthsPutIn - 1));
  std::vector<Curve> curves;
  for (Eigen::Index k = 0; k < kMiddles; ++k) {
    const double share = static_cast<double>(k) / static_cast<double>(kMiddles - 1);
    for (const double width : kWidths) {
      for (const double most : kMost) curves.push_back({low + share * (high - low), width, most});
    }
  }
  return curves;
}

const std::vector<Curve>& curves() {
  static const std::vector<Curve> all = grid_of_curves();
  return all;
}

}  // namespace

double strength_put_in(Eigen::Index place) {
  return kWeakestPutIn * std::exp2(0.5 * static_cast<double>(place));
}

NamedCurve::NamedCurve() : log_weight_(static_cast<Eigen::Index>(curves().size())) {
  // Even odds, whatever number of curves in the grid reach kProvedShare.
  const auto reaches = [](const Curve& curve) {
    return curve.strength_at(kProvedShare).has_value();
  };
  const auto reaching =
      static_cast<double>(std::count_if(curves().begin(), curves().end(), reaches));
  const double others = static_cast<double>(curves().size()) - reaching;
  std::transform(curves().begin(), curves().end(), log_weight_.begin(),
                 [&](const Curve& curve) { return -std::log(reaches(curve) ? reaching : others); });
}

void NamedCurve::count(double strength, bool named) {
  for (std::size_t k = 0; k < curves().size(); ++k) {
    const double share = curves()[k].named(strength);
    log_weight_(static_cast<Eigen::Index>(k)) += named ? std::log(share) : std::log1p(-share);
  }
}

Eigen::VectorXd NamedCurve::posterior() const {
  const Eigen::VectorXd weight = (log_weight_.array() - log_weight_.maxCoeff()).exp();
  return weight / weight.sum();
}

NamedCurve::Smallest NamedCurve::smallest() const {
  const Eigen::VectorXd chance = posterior();
  std::vector<std::pair<double, double>> sizes;  // strength, chance
  Smallest smallest;
  for (std::size_t k = 0; k < curves().size(); ++k) {
    const double own = chance(static_cast<Eigen::Index>(k));
    const std::optional<double> strength = curves()[k].strength_at(kProvedShare);
    if (strength)
      sizes.emplace_back(*strength, own);
    else
      smallest.never += own;
  }
  std::sort(sizes.begin(), sizes.end());
  const auto at = [&](double share) -> std::optional<double> {
    double sum = 0;
    for (const auto& [strength, own] : sizes) {
      if ((sum += own) >= share) return strength;
    }
    return std::nullopt;
  };
  smallest.median = at(0.5);
  smallest.from = at(0.5 * (1 - kCoverage));
  smallest.to = at(0.5 * (1 + kCoverage));
  return smallest;
}

Eigen::Index NamedCurve::next(double share, double drawn) const {
  const Eigen::VectorXd chance = posterior();
  std::size_t at = 0;
  double sum = chance(0);
  while (sum <= drawn && at + 1 < curves().size()) sum += chance(static_cast<Eigen::Index>(++at));
  const std::optional<double> strength = curves()[at].strength_at(share);
  if (!strength) return kStrengthsPutIn - 1;
  const auto place =
      static_cast<Eigen::Index>(std::lround(2 * std::log2(*strength / kWeakestPutIn)));
  return std::clamp(place, Eigen::Index{0}, kStrengthsPutIn - 1);
}

}  // namespace trammel::cause_search
