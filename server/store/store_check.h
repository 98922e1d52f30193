#pragma once

#include <string>

#include "server/base/result.h"

namespace trammel {

/// Checks whether a store could be opened at `path`, without changing or creating anything. Its
/// folder must exist and be writable. A file that exists must be a store with a known schema,
/// without another writer (kConflict). Only the first page is read; open() checks the rest. For a
/// URL: the database must be reachable (kUnreachable), accept the login, and be a store with a
/// schema that this program knows (kRefused).
[[nodiscard]] Status check_store(const std::string& path);

}  // namespace trammel
