#pragma once

#include <string>
#include <utility>
#include <vector>

#include "server/base/result.h"

namespace trammel {

/// What libpq is told for one host: its keywords and values.
using PostgresSettings = std::vector<std::pair<std::string, std::string>>;

/// One for each host that the URL names, in their order; the password stays where libpq looks for it. Refuses what
/// libpq cannot read, without repeating it: it may hold a password.
[[nodiscard]] Result<std::vector<PostgresSettings>> settings_of(const std::string& url);

}  // namespace trammel
