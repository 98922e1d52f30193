#pragma once

#include <cstddef>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "clients/session/session.h"

namespace trammel::cli {

/// The health of each server and of its cells: an object with `cells`, a list of objects in the
/// form of cell_health_json(), with the newest `most` checks of each (0: all). `cell` empty: all
/// cells. Its bytes come from outside.
[[nodiscard]] Result<std::vector<nlohmann::ordered_json>> health_answers(client::Session& session,
                                                                         const std::string& cell,
                                                                         std::size_t most);
/// The cells of all answers; answers of several servers about one record count once.
[[nodiscard]] std::vector<nlohmann::ordered_json> cells_of(
    const std::vector<nlohmann::ordered_json>& answers);

/// The health of a cell or (empty) of all, with the newest `most` checks of each (0: all), from the
/// service: an object for each cell in the form of cell_health_json(). Its bytes come from outside.
[[nodiscard]] Result<std::vector<nlohmann::ordered_json>> health_at(client::Session& session,
                                                                    const std::string& cell,
                                                                    std::size_t most);

}  // namespace trammel::cli
