#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <string>

#include "server/base/result.h"

namespace trammel {

/// Whether the text of this `version`, `batch` or `answer of job` was pruned.
[[nodiscard]] bool is_pruned(SQLite::Database& database, const char* kind, const std::string& cell,
                             const std::string& id);
/// kNotFound.
[[nodiscard]] Failure pruned_failure(const std::string& what);

}  // namespace trammel
