#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>

namespace trammel {

/// The result of fleet_json() as a page: each cell's model, health, next check, and what its twins
/// say of it. `fleet` may come from outside: what it lacks is left out. `at`: of when it is, Unix
/// time, s.
[[nodiscard]] std::string fleet_page(const nlohmann::ordered_json& fleet, std::int64_t at);

}  // namespace trammel
