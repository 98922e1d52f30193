#pragma once

#include <memory>

#include "server/compensate/budget/after_repair.h"
#include "server/measurement/checked_batch.h"

namespace trammel {

/// The outcome of what `before` said, by measurements after the repair: its error sources are
/// identified anew from all rows of `batch` (checked against `cell`), without a bias, and both
/// models are held against each other at these poses. Refuses a cell of another robot, a batch
/// without positions, tools and payloads that `before` was not trained with, and what train()
/// refuses.
[[nodiscard]] Result<AfterRepair> did_it_help(const CompensatedModel& before,
                                              const std::shared_ptr<const Cell>& cell,
                                              const CheckedBatch& batch);

}  // namespace trammel
