#include "server/numerics/chi_square.h"

#include <algorithm>
#include <cmath>

namespace trammel {

namespace {

constexpr double kNegligible = 1e-12;  // share of the noncentral mixture that may be left out
constexpr double kCertain = 8.3;       // standard deviations: 1 to rounding
constexpr int kMostTerms = 20000;

/// Two more degrees of freedom add this to the tail: (x/2)^(k/2) e^(-x/2) / Gamma(k/2 + 1).
double added_by_two(double x, double freedom) {
  return x <= 0 ? 0
                : std::exp(0.5 * freedom * std::log(0.5 * x) - 0.5 * x -
                           std::lgamma(0.5 * freedom + 1));
}

}  // namespace

double chi_square_tail(double x, int freedom) {
  if (freedom <= 0) return x < 0 ? 1 : 0;
  if (x <= 0) return 1;
  double tail = freedom % 2 == 0 ? 0 : std::erfc(std::sqrt(0.5 * x));
  for (int k = freedom % 2; k < freedom; k += 2) tail += added_by_two(x, k);
  return std::min(tail, 1.0);
}

// A mixture of central ones with 2j degrees of freedom more, j from Poisson's distribution.
double chi_square_tail(double x, int freedom, double noncentrality) {
  if (!(noncentrality > 0)) return chi_square_tail(x, freedom);
  // Bound: along the shift alone, a value below x is at most as likely as a normal number below
  // sqrt(x) - sqrt(noncentrality).
  if (std::sqrt(noncentrality) - std::sqrt(std::max(x, 0.0)) > kCertain) return 1;
  const double mean = 0.5 * noncentrality;
  const int first = std::max(0, static_cast<int>(mean - 10 * std::sqrt(mean) - 10));
  double central = chi_square_tail(x, freedom + 2 * first);
  double weight = std::exp(first * std::log(mean) - mean - std::lgamma(first + 1.0));
  double seen = 0, tail = 0;
  for (int j = first; j < first + kMostTerms && seen < 1 - kNegligible; ++j) {
    seen += weight;
    tail += weight * central;
    central = std::min(1.0, central + added_by_two(x, freedom + 2.0 * j));
    weight *= mean / (j + 1);
    if (j > mean && weight < kNegligible * kNegligible) break;
  }
  return std::min(tail, 1.0);
}

double chi_square_limit(double chance, int freedom) {
  double low = 0, high = freedom + 10;
  while (chi_square_tail(high, freedom) > chance) high *= 2;
  for (int i = 0; i < 100; ++i) {
    const double middle = 0.5 * (low + high);
    (chi_square_tail(middle, freedom) > chance ? low : high) = middle;
  }
  return high;
}

}  // namespace trammel
