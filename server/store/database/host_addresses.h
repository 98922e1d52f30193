#pragma once

#include <chrono>
#include <string>
#include <vector>

#include "server/base/result.h"

namespace trammel {

/// The addresses of a host by its name, as getaddrinfo() finds them; an address is its own. A
/// lookup inside libpq could not be interrupted. So a child program does the lookup, and it is
/// killed after `limit`. Refuses (kUnreachable) a name without address.
[[nodiscard]] Result<std::vector<std::string>> addresses_of(const std::string& host,
                                                            std::chrono::milliseconds limit);

}  // namespace trammel
