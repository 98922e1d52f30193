#pragma once

#include <nlohmann/json.hpp>

#include "server/diagnose/diagnosis.h"

namespace trammel {

/// The data from which the charts of a diagnosis page are drawn, in the units they are read in: um,
/// deg, s, degrees Celsius. A key is there only if there is something to draw.
[[nodiscard]] nlohmann::ordered_json diagnosis_charts(const Diagnosis& diagnosis, const Cell& cell);

}  // namespace trammel
