#pragma once

#include <nlohmann/json.hpp>
#include <vector>

#include "server/store/servers.h"
#include "server/store/store_state.h"

namespace trammel {

/// The servers of a record for programs: for each its name, host, role and work, whether it is gone
/// and since when, the number of changes it is behind, and the models that it serves.
[[nodiscard]] nlohmann::ordered_json servers_json(const std::vector<ServerInRecord>& servers);
/// The place of the record, and whether it is reachable or since when it is not.
[[nodiscard]] nlohmann::ordered_json record_json(const RecordState& record);

}  // namespace trammel
