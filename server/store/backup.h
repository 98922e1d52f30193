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
  std::int64_t audit_rows = 0;  ///< each of them as it was written
  std::string audit_hash;       ///< of the last one; to be kept elsewhere
};

/// Copies the store at `from` as it is at one moment into the new file `to`, also while a service
/// writes it: the service waits for nothing, it reads and writes on. The copy stands under its name
/// only once it is whole, on disk and verified (check_store_copy()). Refuses what is no store, and
/// a `to` that is there already. `progress`: the share that is done.
[[nodiscard]] Result<StoreCopy> back_up_store(
    const std::string& from, const std::string& to,
    const std::function<void(double)>& progress = nullptr);

/// Checks that a store that nobody has open is whole: its size and pages, its audit trail row by
/// row, and every batch and model by its hash. Changes nothing. Refuses (kInternal) what is
/// damaged.
[[nodiscard]] Result<StoreCopy> check_store_copy(const std::string& path);

}  // namespace trammel
