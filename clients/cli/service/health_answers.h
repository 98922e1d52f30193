#pragma once

#include <cstddef>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "clients/session/session.h"

namespace trammel::cli {

/// The health that each server tells of itself and of cells: an object with `cells`, a list of
/// objects as cell_health_json() makes them, with the newest `most` checks of each (0: all).
/// `cell` empty: of all. Its bytes come from outside.
[[nodiscard]] Result<std::vector<nlohmann::ordered_json>> health_answers(client::Session& session,
                                                                         const std::string& cell,
                                                                         std::size_t most);
/// The cells of all answers; what several servers say of one record counts once.
[[nodiscard]] std::vector<nlohmann::ordered_json> cells_of(
    const std::vector<nlohmann::ordered_json>& answers);

/// The health of a cell or (empty) of all, with the newest `most` checks of each (0: all), as the
/// service knows it: an object for each cell, as cell_health_json() makes it. Its bytes come from
/// outside.
[[nodiscard]] Result<std::vector<nlohmann::ordered_json>> health_at(client::Session& session,
                                                                    const std::string& cell,
                                                                    std::size_t most);

}  // namespace trammel::cli
