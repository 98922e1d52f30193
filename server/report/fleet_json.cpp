#include "server/report/fleet_json.h"

#include "server/base/units.h"
#include "server/compensate/model_notes.h"
#include "server/fleet/fleet_lines.h"
#include "server/report/cell_needs.h"
#include "server/report/note_json.h"
#include "server/robot/cell_rules.h"

namespace trammel {

namespace {

using nlohmann::ordered_json;

std::vector<FleetMember> members_but(const std::vector<FleetEntry>& cells, std::size_t left_out) {
  std::vector<FleetMember> members;
  for (std::size_t i = 0; i < cells.size(); ++i)
    if (i != left_out && cells[i].model) members.push_back({cells[i].cell, *cells[i].model});
  return members;
}

ordered_json unlike_json(const Unlike& one) {
  return {{"parameter", one.parameter},
          {"unit", one.unit},
          {"value", one.value},
          {"twins", one.fleet_mean},
          {"twins_u95", 2 * one.fleet_stddev},
          {"z", one.z},
          {"sentence", to_string(one)}};
}

/// The comparison with its twins; null if they are too few.
ordered_json unlike_of(const std::vector<FleetEntry>& cells, std::size_t which) {
  const ModelParts& parts = cells[which].model->parts();
  const auto prior = learn_fleet_prior(parts.physics.cell->robot, members_but(cells, which));
  if (!prior) return nullptr;
  ordered_json all = ordered_json::array();
  for (const Unlike& one : unlike_twins(parts, *prior)) all.push_back(unlike_json(one));
  return all;
}

constexpr std::size_t kShownLines = 6;  // lines that differ, as shown to people

/// The budgets of its sisters that are of one drawing; a sister without one is left out.
std::vector<const ErrorBudget*> sisters_of(const std::vector<FleetEntry>& cells,
                                           std::size_t which) {
  std::vector<const ErrorBudget*> sisters;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    if (i == which || !cells[i].model) continue;
    const ModelParts& parts = cells[i].model->parts();
    const Chain& own = cells[which].model->parts().physics.cell->robot;
    if (parts.budget && same_type(parts.physics.cell->robot, own))
      sisters.push_back(&*parts.budget);
  }
  return sisters;
}

/// The lines in which it differs from its sisters; null if it has no budget or they are too few.
ordered_json lines_of(const std::vector<FleetEntry>& cells, std::size_t which) {
  const auto& budget = cells[which].model->parts().budget;
  const std::vector<const ErrorBudget*> sisters = sisters_of(cells, which);
  if (!budget || std::ssize(sisters) < kFewestSisters) return nullptr;
  ordered_json all = ordered_json::array();
  for (const LineAmongSisters& line : lines_among_sisters(*budget, sisters))
    all.push_back(
        {{"line", line.line},
         {"name", line.name},
         {"joint", line.joint >= 0 ? ordered_json(line.joint + 1) : ordered_json(nullptr)},
         {"value", line.own.value},
         {"u95", line.own.u95},
         {"unit", line.own.unit},
         {"sisters", line.sisters.value},
         {"sisters_u95", line.sisters.u95},
         {"robots", line.robots},
         {"difference_rms_mm", to_mm(line.difference_rms)},
         {"z", line.z},
         {"differs", line.differs},
         {"sentence", to_string(line)}});
  return all;
}

ordered_json health_of(const std::string& check) {
  const ordered_json json = ordered_json::parse(check, nullptr, false);
  if (!json.is_object()) return nullptr;
  ordered_json health;
  for (const char* key : {"verdict", "would_have_seen_mm", "tolerance_mm", "due", "why"})
    if (json.contains(key)) health[key] = json[key];
  return health;
}

ordered_json type_json(const FleetPrior& prior, const PhysicalModel& physics) {
  ordered_json type = {
      {"robot", prior.robot}, {"robots", prior.robots}, {"parameters", ordered_json::array()}};
  const std::vector<Parameter> known = physics.parameters();
  for (const FleetParameter& one : prior.parameters) {
    const auto parameter =
        std::find_if(known.begin(), known.end(), [&](const auto& k) { return k.name == one.name; });
    if (parameter == known.end()) continue;
    type["parameters"].push_back({{"parameter", one.name},
                                  {"unit", parameter->unit},
                                  {"mean", one.mean * parameter->scale},
                                  {"spread", one.spread * parameter->scale}});
  }
  return type;
}

}  // namespace

ordered_json fleet_json(const std::vector<FleetEntry>& cells, std::int64_t now) {
  ordered_json json = {{"cells", ordered_json::array()}, {"types", ordered_json::array()}};
  std::vector<std::string> told;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const FleetEntry& entry = cells[i];
    ordered_json one = {{"cell", entry.cell}};
    one["version"] = entry.version > 0 ? ordered_json(entry.version) : ordered_json(nullptr);
    one["health"] = health_of(entry.last_check);
    one["need"] = need_json(need_of({.cell = entry.cell,
                                     .model = entry.model ? &*entry.model : nullptr,
                                     .last_check = entry.last_check,
                                     .now = now}));
    if (entry.model) {
      const Chain& robot = entry.model->cell().robot;
      one["robot"] = robot.name();
      one["model"] = entry.model->provenance().id;
      one["unlike_twins"] = unlike_of(cells, i);
      one["lines_among_sisters"] = lines_of(cells, i);
      one["notes"] = notes_json(notes_of(*entry.model));
      const auto prior = learn_fleet_prior(robot, members_but(cells, cells.size()));
      if (prior && std::find(told.begin(), told.end(), robot.name()) == told.end()) {
        told.push_back(robot.name());
        json["types"].push_back(type_json(*prior, entry.model->parts().physics));
      }
    }
    json["cells"].push_back(std::move(one));
  }
  return json;
}

namespace {

/// `  Its check was due by 2026-11-20. To do: ...`; empty from a server that does not say it.
std::string need_text(const ordered_json& cell) {
  if (!cell.contains("need") || !cell["need"].is_object()) return "";
  const std::string action = cell["need"].value("action", "");
  return fmt::format("  {}{}\n", cell["need"].value("sentence", ""),
                     action.empty() ? "" : " To do: " + action);
}

/// The lines of its budget in which it differs, at most kShownLines.
std::string lines_text(const ordered_json& cell) {
  if (!cell.contains("lines_among_sisters") || !cell["lines_among_sisters"].is_array()) return "";
  std::string text;
  std::size_t shown = 0;
  for (const ordered_json& line : cell["lines_among_sisters"]) {
    if (!line.at("differs").get<bool>() || shown++ == kShownLines) break;
    text += "    " + line.at("sentence").get<std::string>() + "\n";
  }
  return text.empty() ? "  no line of its budget differs from its sisters\n"
                      : "  its budget differs from its sisters in:\n" + text;
}

}  // namespace

std::string fleet_text(const ordered_json& fleet) {
  std::string text;
  for (const ordered_json& cell : fleet.at("cells")) {
    const ordered_json& health = cell.at("health");
    text += fmt::format("{}{}: {}", cell.at("cell").get<std::string>(),
                        cell.contains("robot") ? " (" + cell["robot"].get<std::string>() + ")" : "",
                        health.is_object() ? health.value("verdict", "") : "not checked yet");
    if (health.is_object() && !health.value("due", "").empty())
      text += fmt::format(", next check {}", health.value("due", ""));
    text += "\n" + need_text(cell);
    if (!cell.contains("unlike_twins")) {
      text += "  no model in force\n";
    } else if (cell["unlike_twins"].is_null()) {
      text += "  too few robots of its type to compare each of its parameters\n";
    } else if (cell["unlike_twins"].empty()) {
      text += "  like its twins\n";
    } else {
      for (const ordered_json& one : cell["unlike_twins"])
        text += "  unlike its twins: " + one.at("sentence").get<std::string>() + "\n";
    }
    text += lines_text(cell);
  }
  for (const ordered_json& type : fleet.at("types"))
    text += fmt::format("{}: learned from {} robots\n", type.at("robot").get<std::string>(),
                        type.at("robots").get<int>());
  return text;
}

}  // namespace trammel
