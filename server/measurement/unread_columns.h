#pragma once

#include <string>
#include <vector>

#include "server/measurement/measurement.h"

namespace trammel {

/// A sentence on columns of changing numbers from which nothing is learned. It gives the name of
/// each, and the remedy if they are an orientation or a direction. `told`: columns that were
/// already reported. Empty if there are none.
[[nodiscard]] std::string unread_columns(const MeasurementBatch& batch,
                                         const std::vector<std::string>& told = {});

}  // namespace trammel
