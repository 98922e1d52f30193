#pragma once

#include <nlohmann/json.hpp>
#include <vector>

#include "server/store/servers.h"
#include "server/store/store_state.h"

namespace trammel {

/// The servers of a record for programs: of each its name, host, what it is and does, whether it is
/// gone and since when, by how many changes it is behind, and what it serves.
[[nodiscard]] nlohmann::ordered_json servers_json(const std::vector<ServerInRecord>& servers);
/// Where the record is, and whether it is reachable or since when not.
[[nodiscard]] nlohmann::ordered_json record_json(const RecordState& record);

}  // namespace trammel
