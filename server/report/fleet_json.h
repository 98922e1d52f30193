#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "server/fleet/fleet_prior.h"

namespace trammel {

/// A cell in a list of several cells.
struct FleetEntry {
  std::string cell;
  int version = 0;                        ///< in force; 0: a file
  std::optional<CompensatedModel> model;  ///< empty: none in force, or not in memory
  std::string last_check = {};            ///< in the form of health_json(); empty: none
};

/// Cells with their last health verdicts, what they need (`need`, see cell_needs.h) and their
/// unusual values among robots of their type, and the learned values of each type. `now`: Unix
/// time, s.
[[nodiscard]] nlohmann::ordered_json fleet_json(const std::vector<FleetEntry>& cells,
                                                std::int64_t now);
/// The output of fleet_json() for people.
[[nodiscard]] std::string fleet_text(const nlohmann::ordered_json& fleet);

}  // namespace trammel
