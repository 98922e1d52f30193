#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "server/base/result.h"

namespace trammel {

/// A copy of a store.
struct StoreCopy {
  std::string identity;     ///< of the store
  std::int64_t bytes = 0;   ///< of the file
  std::int64_t models = 0;  ///< versions of all cells
  std::int64_t batches = 0;
  std::int64_t audit_rows = 0;  ///< all verified
  std::string audit_hash;       ///< of the last row; keep it elsewhere
};

/// Copies the store at `from`, as it is at one moment, into the new file `to`. This also works
/// while a service writes the store; the service does not wait. The copy gets its name only when it
/// is complete, on disk and verified (check_store_copy()). Refuses a `from` that is not a store,
/// and a `to` that exists. `progress`: the share done.
[[nodiscard]] Result<StoreCopy> back_up_store(
    const std::string& from, const std::string& to,
    const std::function<void(double)>& progress = nullptr);

/// Checks that a store without open connections is complete: its size and pages, its audit trail
/// row by row, and every batch and model by its hash. Changes nothing. Refuses (kInternal) a
/// damaged store.
[[nodiscard]] Result<StoreCopy> check_store_copy(const std::string& path);

}  // namespace trammel
