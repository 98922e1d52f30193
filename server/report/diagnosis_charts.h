#pragma once

#include <nlohmann/json.hpp>

#include "server/diagnose/diagnosis.h"

namespace trammel {

/// The data for the charts of a diagnosis page, in people's units: um, deg, s, degrees Celsius. A
/// key exists only if there is something to draw.
[[nodiscard]] nlohmann::ordered_json diagnosis_charts(const Diagnosis& diagnosis, const Cell& cell);

}  // namespace trammel
