#pragma once

#include <memory>

#include "server/diagnose/diagnose_options.h"
#include "server/diagnose/diagnosis.h"
#include "server/measurement/checked_batch.h"

namespace trammel {

/// Finds the part of the training rows of `batch` (checked against `cell`) that the cell's error
/// sources do not explain, names the causes, and states what the data cannot tell. Refuses the same
/// as calibrate(), and orientations that do not follow the joints. Returns busy if
/// `options.progress` gives up. Same batch, cell and seed give the same diagnosis.
[[nodiscard]] Result<Diagnosis> diagnose(const std::shared_ptr<const Cell>& cell,
                                         const CheckedBatch& batch, const DiagnoseOptions& options);

}  // namespace trammel
