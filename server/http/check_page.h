#pragma once

#include <string>

#include "server/http/page_shell.h"

namespace trammel {

/// What a health check found (report/README.md), for people. `findings`: its JSON as it is stored, perhaps by an
/// earlier version of the program: what it does not have is left out.
[[nodiscard]] ServicePage check_page(const std::string& findings, const std::string& cell, std::int64_t job);

}  // namespace trammel
