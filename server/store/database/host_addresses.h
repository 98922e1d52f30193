#pragma once

#include <chrono>
#include <string>
#include <vector>

#include "server/base/result.h"

namespace trammel {

/// The addresses of a host by its name, as getaddrinfo() finds them; an address is its own. Where
/// libpq looks a name up nobody can end it: here a program is asked that is ended after `limit`.
/// Refuses (kUnreachable) what is not found.
[[nodiscard]] Result<std::vector<std::string>> addresses_of(const std::string& host,
                                                            std::chrono::milliseconds limit);

}  // namespace trammel
