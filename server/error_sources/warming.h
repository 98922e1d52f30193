#pragma once

#include <optional>
#include <string>

#include "server/error_sources/error_source.h"

/// The warmth of a part of the arm that follows the recorded temperature with a lag.
namespace trammel {

/// Its time constant: half an hour, give or take; within kHeatLags.
[[nodiscard]] Parameter heat_lag_parameter(std::string name);

struct Warming {
  double kelvin = 0;  ///< above the 20 degrees Celsius of drawings
  double by_lag = 0;  ///< K/s, its derivative by the time constant
};
/// The warmth of a part with the time constant `lag` (s). Where the history of the temperature is
/// unknown, the part is as warm as the thermometer. Empty without a temperature.
[[nodiscard]] std::optional<Warming> warming_at(const PoseContext& context, double lag);

}  // namespace trammel
