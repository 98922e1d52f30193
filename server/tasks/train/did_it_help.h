#pragma once

#include <memory>

#include "server/compensate/budget/after_repair.h"
#include "server/measurement/checked_batch.h"

namespace trammel {

/// Tests the repair that `before` suggested by measurements after it. The model's error sources are
/// identified anew from all rows of `batch` (checked against `cell`), without a bias, and both
/// models are compared at these poses. Refuses a cell of another robot, a batch without positions,
/// tools and payloads that `before` was not trained with, and the same as train().
[[nodiscard]] Result<AfterRepair> did_it_help(const CompensatedModel& before,
                                              const std::shared_ptr<const Cell>& cell,
                                              const CheckedBatch& batch);

}  // namespace trammel
