#pragma once

#include <cstddef>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "clients/session/session.h"

namespace trammel::cli {

/// What the service knows of the health of a cell or (empty) of all, with the newest `most` checks of each (0: all): an
/// object for each cell, as cell_health_json() makes it. Its bytes come from outside.
[[nodiscard]] Result<std::vector<nlohmann::ordered_json>> health_at(client::Session& session, const std::string& cell,
                                                                    std::size_t most);

}  // namespace trammel::cli
