#pragma once

#include <memory>

#include "server/diagnose/diagnose_options.h"
#include "server/diagnose/diagnosis.h"
#include "server/measurement/checked_batch.h"

namespace trammel {

/// Shows what `cell`'s error sources do not explain of the training rows of `batch` (checked
/// against it), names the causes that do, and says what cannot be told. Refuses what calibrate()
/// does and orientations that do not follow the joints; busy where `options.progress` gives up.
/// Same batch, cell and seed, same diagnosis.
[[nodiscard]] Result<Diagnosis> diagnose(const std::shared_ptr<const Cell>& cell,
                                         const CheckedBatch& batch, const DiagnoseOptions& options);

}  // namespace trammel
