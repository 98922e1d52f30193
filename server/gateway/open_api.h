#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace trammel {

/// The description of all addresses (OpenAPI 3.1): paths, options, roles and bodies from the table
/// of routes, the figures of answers from the tables of exchange/values.h.
[[nodiscard]] nlohmann::ordered_json open_api(const std::string& version);

}  // namespace trammel
