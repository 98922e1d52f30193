#pragma once

#include <string>

#include "server/base/result.h"
#include "server/store/database/database.h"

namespace trammel {

/// True if the text of this `version`, `batch` or `answer of job` was pruned.
[[nodiscard]] bool is_pruned(Database& database, const char* kind, const std::string& cell,
                             const std::string& id);
/// kNotFound.
[[nodiscard]] Failure pruned_failure(const std::string& what);

}  // namespace trammel
