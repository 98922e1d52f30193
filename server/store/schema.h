#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <string>

#include "server/base/result.h"

namespace trammel {

/// Makes an open file a store of today's schema: an empty one gets its tables, an older one what it lacks. Refuses
/// (kRefused) a file of another program or of a newer schema, (kInternal) a damaged one.
[[nodiscard]] Status prepare_file(SQLite::Database& database, const std::string& path);

}  // namespace trammel
