#pragma once

#include <nlohmann/json.hpp>

#include "server/compensate/compensated_model.h"

namespace trammel {

/// rms, mean, 99.7 %, maximum and axes, mm.
[[nodiscard]] nlohmann::ordered_json figures_json(const ErrorFigures& figures);

}  // namespace trammel
