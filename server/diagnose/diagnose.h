#pragma once

#include <memory>

#include "server/diagnose/diagnose_options.h"
#include "server/diagnose/diagnosis.h"

namespace trammel {

/// Shows what `cell`'s error sources do not explain of `batch`, names the causes that do, and says what cannot be told.
/// `batch` is checked against the cell here; refusals as there and as calibrate() says. Busy where `options.progress`
/// gives up. Same batch, cell and seed, same diagnosis.
[[nodiscard]] Result<Diagnosis> diagnose(const std::shared_ptr<const Cell>& cell, const MeasurementBatch& batch,
                                         const DiagnoseOptions& options);

}  // namespace trammel
