#pragma once

#include "server/measurement/measurement.h"

namespace trammel {

/// True if every pose has a temperature, and the warmest is more than 2 K above the coldest, so
/// that thermal growth shows.
[[nodiscard]] bool shows_warmth(const MeasurementBatch& batch);

}  // namespace trammel
