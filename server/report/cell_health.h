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
  std::vector<std::string> batches;  ///< none: the batch came with it
  std::string check;                 ///< as health_json() has it
};

/// The model that a cell is served with, and how that was judged.
struct ServedOnRecord {
  int version = 0;
  std::string model;                       ///< its id
  std::int64_t since = 0;                  ///< Unix time, s
  std::optional<int> version_before = {};  ///< where a rollback leads
  std::optional<double> before, after,
      limit;  ///< m rms, of what was in force until then and of it; what it had to be below
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
/// For people, of what cell_health_json() made: the verdict, when the next check is due, what was
/// found when. `json` may come from outside: what it lacks is left out.
[[nodiscard]] std::string cell_health_text(const nlohmann::ordered_json& json);
/// The first line of it.
[[nodiscard]] std::string cell_health_line(const nlohmann::ordered_json& json);

}  // namespace trammel
