#include "server/error_sources/warming.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace trammel {

namespace {

constexpr double kReferenceTemperature = 20;  // degrees Celsius
constexpr double kSecondsPerMinute = 60;
constexpr double kLag = 30 * kSecondsPerMinute;  // of a gearbox in its casting
constexpr double kLagSpread = 20 * kSecondsPerMinute;

}  // namespace

Parameter heat_lag_parameter(std::string name) {
  return {std::move(name), "min", 1 / kSecondsPerMinute, kLag, kLagSpread, kHeatLags.front(), true};
}

std::optional<Warming> warming_at(const PoseContext& context, double lag) {
  if (!context.temperature) return std::nullopt;
  if (context.lagged.empty()) return Warming{*context.temperature - kReferenceTemperature, 0};
  // Between the time constants that were computed, evenly in their logarithm.
  const double inside = std::clamp(lag, kHeatLags.front(), kHeatLags.back());
  const auto above = std::upper_bound(kHeatLags.begin() + 1, kHeatLags.end() - 1, inside);
  const auto k = static_cast<std::size_t>(above - kHeatLags.begin());
  const double span = std::log(kHeatLags[k] / kHeatLags[k - 1]);
  const double step = context.lagged[k] - context.lagged[k - 1];
  const double felt = context.lagged[k - 1] + std::log(inside / kHeatLags[k - 1]) / span * step;
  return Warming{felt - kReferenceTemperature, inside == lag ? step / (span * lag) : 0};
}

}  // namespace trammel
