#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "server/fleet/fleet_prior.h"

namespace trammel {

/// A cell as it is listed among others.
struct FleetEntry {
  std::string cell;
  int version = 0;                        ///< in force; 0: a file
  std::optional<CompensatedModel> model;  ///< empty: none in force, or not in memory
  std::string last_check = {};            ///< as health_json() has it; empty: none
};

/// Cells, what was last said of their health, and what is unusual about each among robots of its
/// type; what was learned of each type.
[[nodiscard]] nlohmann::ordered_json fleet_json(const std::vector<FleetEntry>& cells);
/// For people, of what fleet_json() made.
[[nodiscard]] std::string fleet_text(const nlohmann::ordered_json& fleet);

}  // namespace trammel
