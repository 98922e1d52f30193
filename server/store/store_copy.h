#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "server/base/result.h"

namespace trammel {

/// The content of a store, and its digests for comparison.
struct StoreContent {
  struct Table {
    std::string name;
    std::int64_t rows = 0;
    std::string sha256;  ///< the same in a file and in a database
  };
  std::string identity;
  std::vector<Table> tables;
  std::int64_t audit_rows = 0;  ///< all verified
  std::string audit_hash;       ///< of the last row; keep it elsewhere
};

/// Checks a whole store, a file or a database by its URL, even while services use it: every batch,
/// model and row of the audit trail. Changes nothing. Refuses (kInternal) a damaged store.
[[nodiscard]] Result<StoreContent> look_through_store(const std::string& place);

/// The fate of the store that was copied.
enum class SourceAfter {
  kMoved,  ///< its trail says where it went, and no server serves it any more
  kKept    ///< it stays unchanged: the copy is for a trial, or to keep
};

/// Copies a store, a file or database, to another, with all of its history: the same versions, the
/// same trail, the same identity. The copy is verified table by table. Then the trail of the new
/// store records its origin. A file must not be served meanwhile; a database that is moved rejects
/// changes by services during the copy and afterwards. Refuses a target that is not empty.
/// `progress`: the share done.
[[nodiscard]] Result<StoreContent> copy_store(
    const std::string& from, const std::string& to, SourceAfter source,
    const std::function<void(double)>& progress = nullptr);

}  // namespace trammel
