#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>

namespace trammel {

/// The result of fleet_json() as a page: each cell's model, health, next check, and comparison with
/// its twins. `fleet` may come from outside: missing members are left out. `at`: the time of the
/// page, Unix time, s.
[[nodiscard]] std::string fleet_page(const nlohmann::ordered_json& fleet, std::int64_t at);

}  // namespace trammel
