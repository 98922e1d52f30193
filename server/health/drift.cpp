#include "server/health/drift.h"

#include <algorithm>
#include <cmath>

namespace trammel {

namespace {

constexpr double kDay = 86400;      // s
constexpr double kSurprise = 2.71;  // of twice the log likelihood: 95 %, one side
constexpr double kLeastVariance = 1e-14, kMostVariance = 1e-4;  // m^2
constexpr int kOfADecade = 12;  // grid of variances; rates have twice as many
constexpr int kDecades = 10;

/// The misfit at any variance, m^2, interpolated between the given ones.
double misfit_at(const DriftSeen& seen, double variance) {
  const double at = kOfADecade * std::log10(std::max(variance, kLeastVariance) / kLeastVariance);
  const auto last = static_cast<double>(seen.misfit.size() - 1);
  if (at >= last) return seen.misfit.back();
  const auto below = static_cast<std::size_t>(at);
  const double share = at - std::floor(at);
  return (1 - share) * seen.misfit[below] + share * seen.misfit[below + 1];
}

double length_of(const DriftSeen& seen) { return static_cast<double>(seen.until - seen.from); }

/// The number of independent checks that these are worth.
double independent(const std::vector<DriftSeen>& checks) {
  double sum = 0;
  for (const DriftSeen& a : checks) {
    for (const DriftSeen& b : checks) {
      const auto overlap = static_cast<double>(
          std::max<std::int64_t>(0, std::min(a.until, b.until) - std::max(a.from, b.from)));
      sum += overlap * overlap / (length_of(a) * length_of(b));
    }
  }
  const auto n = static_cast<double>(checks.size());
  return n * n / sum;
}

bool says_something(const DriftSeen& seen) {
  return length_of(seen) >= kDay && seen.misfit.size() == drift_variances().size() &&
         std::all_of(seen.misfit.begin(), seen.misfit.end(),
                     [](double misfit) { return std::isfinite(misfit); });
}

}  // namespace

const std::vector<double>& drift_variances() {
  static const std::vector<double> variances = [] {
    std::vector<double> all;
    for (int k = 0; k <= kDecades * kOfADecade; ++k)
      all.push_back(kLeastVariance * std::pow(10, static_cast<double>(k) / kOfADecade));
    return all;
  }();
  return variances;
}

double DriftRate::after(double rate, double seconds) { return std::sqrt(rate * seconds); }

std::optional<DriftRate> drift_rate(const std::vector<DriftSeen>& checks) {
  std::vector<DriftSeen> telling;
  std::copy_if(checks.begin(), checks.end(), std::back_inserter(telling), says_something);
  if (telling.empty()) return std::nullopt;
  DriftRate rate;
  rate.checks = static_cast<int>(telling.size());
  rate.weight = independent(telling);
  double longest = 0;
  std::int64_t first = telling.front().from, last = telling.front().until;
  for (const DriftSeen& seen : telling) {
    longest = std::max(longest, length_of(seen));
    first = std::min(first, seen.from);
    last = std::max(last, seen.until);
  }
  rate.span = static_cast<double>(last - first);
  std::vector<double> rates, misfits;
  const double slowest = kLeastVariance / longest;
  for (double r = slowest; r * kDay < kMostVariance; r *= std::pow(10, 0.5 / kOfADecade)) {
    double sum = 0;
    for (const DriftSeen& seen : telling) sum += misfit_at(seen, r * length_of(seen));
    rates.push_back(r);
    misfits.push_back(sum * rate.weight / rate.checks);
  }
  const auto least = std::min_element(misfits.begin(), misfits.end());
  rate.best =
      least == misfits.begin() ? 0 : rates[static_cast<std::size_t>(least - misfits.begin())];
  for (std::size_t k = 0; k < rates.size(); ++k) {
    if (misfits[k] < *least + kSurprise) rate.most = rates[k];
  }
  for (std::size_t k = rates.size(); k-- > 0;) {
    if (misfits[k] < *least + kSurprise) rate.least = k == 0 ? 0 : rates[k];
  }
  return rate;
}

}  // namespace trammel
