#include "server/base/shown_value.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>

#include "server/base/units.h"

namespace trammel {

namespace {

constexpr int kMostDecimals = 4;
constexpr int kMostDigits = 5;  // in front of the point; more do not read as a number

constexpr double kSmallestPlain = 1e-7;  // a smaller uncertainty is written with a power of ten

/// Units that begin with an angle, and the units that people read instead.
struct Angular {
  std::string_view unit, read;
  double scale;  // degrees of the angle, and the rest
};
constexpr std::array<Angular, 3> kAngular = {
    {{"rad", "deg", 1}, {"rad/h", "deg/h", 1}, {"rad/Nmm", "deg/kNm", 1e6}}};

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

Reading reading_of(const std::string& unit) {
  for (const Angular& one : kAngular) {
    if (one.unit == unit) return {one.scale * to_deg(1), std::string(one.read)};
  }
  return {1, unit};
}

ShownValue show_read(double value, double expanded, const Reading& reading) {
  const double read = reading.scale * value, u95 = reading.scale * expanded;
  const bool measure = reading.unit.starts_with("mm") || reading.unit.starts_with("deg");
  const bool small =
      u95 > kSmallestPlain && u95 < 1;  // beyond, both are written without powers of ten anyway
  if (!measure || !small) return show_with_uncertainty(read, u95);
  const int decimals = 1 - order(u95);
  return {fmt::format("{:.{}f}", read, decimals), fmt::format("{:.{}f}", u95, decimals)};
}

}  // namespace trammel
