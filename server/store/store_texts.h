#pragma once

#include <cstdint>
#include <string>

#include "server/base/result.h"
#include "server/store/database/database.h"

/// The parts of a store that can be verified by its own hashes.
namespace trammel {

/// Checks that every batch has the accepted text, and every model the stored one. Pruned ones have
/// no text. Refuses (kInternal) the first that differs.
[[nodiscard]] Status check_texts(Database& database, const std::string& place);

struct TrailEnd {
  std::int64_t rows = 0;
  std::string hash;  ///< of the last row
};
/// The audit trail as a whole. Refuses (kInternal) one that was changed.
[[nodiscard]] Result<TrailEnd> check_trail(Database& database);

}  // namespace trammel
