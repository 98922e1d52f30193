#pragma once

#include <string>

#include "server/base/result.h"
#include "server/store/database/database.h"

/// Cells as rows, for the transactions of batches, jobs and models.
namespace trammel {

/// Locks the cell until the transaction ends, so that nobody else changes it. Call it before every
/// other lock; the order is cells, jobs, the rest, the end of the audit trail.
void lock_cell(Database& database, const std::string& cell);

/// The number of the cell's next version, one model's for ever.
[[nodiscard]] Result<int> next_version(Database& database, const std::string& cell);
/// Ensures that later models have higher numbers.
void count_version(Database& database, const std::string& cell, int version);

}  // namespace trammel
