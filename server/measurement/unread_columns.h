#pragma once

#include <string>
#include <vector>

#include "server/measurement/measurement.h"

namespace trammel {

/// A sentence on the columns of the file that hold other numbers from row to row and that nothing
/// is learned from: each by its name, and what to do where they are an orientation or a direction.
/// `told`: columns that somebody has spoken of. Empty where there are none.
[[nodiscard]] std::string unread_columns(const MeasurementBatch& batch,
                                         const std::vector<std::string>& told = {});

}  // namespace trammel
