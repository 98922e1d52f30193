#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "server/base/result.h"

namespace trammel {

/// The content of a store, and how to tell it from any other content.
struct StoreContent {
  struct Table {
    std::string name;
    std::int64_t rows = 0;
    std::string sha256;  ///< the same in a file and in a database
  };
  std::string identity;
  std::vector<Table> tables;
  std::int64_t audit_rows = 0;  ///< each of them as it was written
  std::string audit_hash;       ///< of the last one; to be kept elsewhere
};

/// Looks through a whole store, a file or a database by its URL, also while services use it: every
/// batch, model and row of the audit trail. Changes nothing. Refuses (kInternal) what is damaged.
[[nodiscard]] Result<StoreContent> look_through_store(const std::string& place);

/// The fate of the store that was copied.
enum class SourceAfter {
  kMoved,  ///< its trail says where it went, and no server serves it any more
  kKept    ///< it stays as it is: the copy is one to try, or to keep
};

/// Copies a store, a file or database, to another, with all that was ever in it: the same versions,
/// the same trail, the same identity. It is verified table by table before it counts. The trail of
/// the new one then says where it came from. A file must not be served meanwhile; of a database
/// that is moved the services change nothing meanwhile, and nothing afterwards. Refuses a target
/// that is not empty. `progress`: the share that is done.
[[nodiscard]] Result<StoreContent> copy_store(
    const std::string& from, const std::string& to, SourceAfter source,
    const std::function<void(double)>& progress = nullptr);

}  // namespace trammel
