#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "server/compensate/session_changes.h"

namespace trammel {

/// A check that was made of a cell.
struct CheckOnRecord {
  std::int64_t job = 0;
  std::int64_t at = 0;               ///< Unix time, s
  std::vector<std::string> batches;  ///< empty: the batch came with it
  std::string check;                 ///< in the form of health_json()
};

/// The model with which a cell is served, and the verdict on it.
struct ServedOnRecord {
  int version = 0;
  std::string model;                       ///< its id
  std::int64_t since = 0;                  ///< Unix time, s
  std::optional<int> version_before = {};  ///< the target of a rollback
  std::optional<double> before, after,
      limit;  ///< m rms: the model in force until then, the new one, and the limit for the new one
  std::string why;
  std::vector<SessionChange> between_sessions = {};
};

/// The record that a service has of a cell's health.
struct CellHealth {
  std::string cell;
  std::optional<ServedOnRecord> served = {};  ///< empty: none is in force
  std::vector<CheckOnRecord> checks = {};     ///< oldest first
};

/// For programs. `verdict` and `due` are those of the last check of the model in force; null and
/// empty where none was made.
[[nodiscard]] nlohmann::ordered_json cell_health_json(const CellHealth& health);
/// The output of cell_health_json() for people: the verdict, the date of the next check, and dated
/// findings. `json` may come from outside: missing members are left out.
[[nodiscard]] std::string cell_health_text(const nlohmann::ordered_json& json);
/// The first line of that text.
[[nodiscard]] std::string cell_health_line(const nlohmann::ordered_json& json);

}  // namespace trammel
