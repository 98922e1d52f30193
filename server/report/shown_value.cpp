#include "server/report/shown_value.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace trammel {

namespace {

constexpr int kMostDecimals = 4;
constexpr int kMostDigits = 5;  // in front of the point that still read as a number

/// Power of ten of the first digit.
int order(double x) { return x == 0 ? 0 : static_cast<int>(std::floor(std::log10(std::abs(x)))); }

}  // namespace

ShownValue show_with_uncertainty(double value, double expanded) {
  if (!(expanded > 0) || !std::isfinite(expanded))
    return {fmt::format("{:.4g}", value), fmt::format("{:.2g}", expanded)};
  const int decimals = 1 - order(expanded);
  if (decimals >= 0 && decimals <= kMostDecimals)
    return {fmt::format("{:.{}f}", value, decimals), fmt::format("{:.{}f}", expanded, decimals)};
  if (decimals < 0 && order(expanded) < kMostDigits && order(value) < kMostDigits) {
    const double step = std::pow(10, -decimals);
    return {fmt::format("{:.0f}", std::round(value / step) * step),
            fmt::format("{:.0f}", std::round(expanded / step) * step)};
  }
  const int digits = value == 0 ? 1 : std::clamp(order(value) - order(expanded) + 1, 0, 9);
  return {fmt::format("{:.{}e}", value, digits), fmt::format("{:.1e}", expanded)};
}

}  // namespace trammel
