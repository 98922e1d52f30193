#include "server/report/cell_health.h"

#include <array>
#include <ctime>

#include "server/base/units.h"
#include "server/report/session_changes_json.h"

namespace trammel {

namespace {

using nlohmann::ordered_json;

/// The keys of a check that a record of checks repeats.
constexpr const char* kOfCheck[] = {"verdict",
                                    "why",
                                    "model",
                                    "tolerance_mm",
                                    "rms_mm",
                                    "expected_rms_mm",
                                    "would_have_seen_mm",
                                    "changed",
                                    "due",
                                    "due_because"};

ordered_json optional_mm(const std::optional<double>& m) {
  return m ? ordered_json(to_mm(*m)) : ordered_json(nullptr);
}

ordered_json check_json(const CheckOnRecord& record) {
  ordered_json json = {{"job", record.job}, {"at_unix_s", record.at}, {"batches", record.batches}};
  const ordered_json check = ordered_json::parse(record.check, nullptr, false);
  for (const char* key : kOfCheck)
    json[key] = check.is_object() && check.contains(key) ? check[key] : nullptr;
  return json;
}

ordered_json served_json(const std::string& cell, const ServedOnRecord& served) {
  const bool has_before = served.version_before.has_value();
  return {
      {"version", served.version},
      {"model", served.model},
      {"since_unix_s", served.since},
      {"version_before", has_before ? ordered_json(*served.version_before) : ordered_json(nullptr)},
      {"before_mm", optional_mm(served.before)},
      {"after_mm", optional_mm(served.after)},
      {"limit_mm", optional_mm(served.limit)},
      {"why", served.why},
      {"next",
       has_before
           ? fmt::format("trammel rollback --service --cell {} puts version {} back in force", cell,
                         *served.version_before)
           : ""}};
}

/// The last check of the model in force.
const ordered_json* last_check(const CellHealth& health, const ordered_json& checks) {
  if (!health.served || checks.empty()) return nullptr;
  const ordered_json& last = checks.back();
  return last["model"].is_string() && last["model"].get<std::string>() == health.served->model
             ? &last
             : nullptr;
}

std::string text_of(const ordered_json& json, const char* key) {
  return json.is_object() && json.contains(key) && json[key].is_string()
             ? json[key].get<std::string>()
             : "";
}

/// `2026-11-21`, UTC.
std::string day_of(const ordered_json& json) {
  if (!json.contains("at_unix_s") || !json["at_unix_s"].is_number_integer()) return "";
  const std::time_t time = json["at_unix_s"].get<std::int64_t>();
  std::tm utc{};
  std::array<char, 32> text{};
  if (::gmtime_r(&time, &utc) != nullptr) std::strftime(text.data(), text.size(), "%Y-%m-%d", &utc);
  return text.data();
}

std::string check_line(const ordered_json& check) {
  return fmt::format("  {} {}: {}\n", day_of(check), text_of(check, "verdict"),
                     text_of(check, "why"));
}

}  // namespace

ordered_json cell_health_json(const CellHealth& health) {
  ordered_json checks = ordered_json::array();
  for (const CheckOnRecord& record : health.checks) checks.push_back(check_json(record));
  const ordered_json* last = last_check(health, checks);
  ordered_json json = {{"cell", health.cell},
                       {"verdict", last ? (*last)["verdict"] : ordered_json(nullptr)},
                       {"due", last ? text_of(*last, "due") : ""},
                       {"due_because", last ? text_of(*last, "due_because") : ""}};
  json["in_force"] =
      health.served ? served_json(health.cell, *health.served) : ordered_json(nullptr);
  json["between_sessions"] = session_changes_json(health.served ? health.served->between_sessions
                                                                : std::vector<SessionChange>());
  json["checks"] = std::move(checks);
  return json;
}

std::string cell_health_line(const ordered_json& json) {
  const std::string verdict = text_of(json, "verdict"), due = text_of(json, "due"),
                    why = text_of(json, "due_because");
  std::string text =
      fmt::format("cell {}: {}", text_of(json, "cell"),
                  verdict.empty() ? "the model in force was not checked yet" : verdict);
  if (!due.empty()) text += fmt::format(", next check {}", due);
  if (due.empty() && !why.empty()) text += "; " + why;
  return text + "\n";
}

std::string cell_health_text(const ordered_json& json) {
  std::string text = cell_health_line(json);
  if (!json.is_object()) return text;
  for (const char* key : {"checks", "between_sessions"}) {
    if (!json.contains(key) || !json[key].is_array()) continue;
    for (const ordered_json& one : json[key])
      text += key == std::string_view("checks") ? check_line(one)
                                                : "  " + text_of(one, "sentence") + "\n";
  }
  return text;
}

}  // namespace trammel
