#pragma once

#include <nlohmann/json.hpp>

#include "server/compensate/compensated_model.h"

namespace trammel {

/// rms, mean, 99.7 %, maximum and axes, mm.
[[nodiscard]] nlohmann::ordered_json figures_json(const ErrorFigures& figures);
/// `length` (m) in mm; null where it is not known.
[[nodiscard]] nlohmann::ordered_json length_json(const std::optional<double>& length);

}  // namespace trammel
