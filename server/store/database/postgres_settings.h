#pragma once

#include <chrono>
#include <string>
#include <utility>
#include <vector>

#include "server/base/result.h"

namespace trammel {

/// libpq's settings for one host: keywords and values.
using PostgresSettings = std::vector<std::pair<std::string, std::string>>;

/// One for each host that the URL names, in their order; the password stays where libpq looks for
/// it. Refuses a URL that libpq cannot read, without quoting it, since it may hold a password.
[[nodiscard]] Result<std::vector<PostgresSettings>> settings_of(const std::string& url);

/// The settings for each address of the host, so that libpq looks up no name; sockets stay as they
/// are. `limit`: of the look-up. A host that only the environment or a service file names is still
/// looked up by libpq.
[[nodiscard]] Result<std::vector<PostgresSettings>> with_addresses(const PostgresSettings& host,
                                                                   std::chrono::milliseconds limit);

}  // namespace trammel
