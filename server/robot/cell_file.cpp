#include "server/robot/cell_file.h"

#include <cmath>
#include <filesystem>
#include <system_error>

#include "server/base/hash.h"
#include "server/base/name_check.h"
#include "server/base/text_file.h"
#include "server/base/units.h"
#include "server/base/yaml_file.h"
#include "server/robot/cell.h"
#include "server/robot/cell_obstacles.h"
#include "server/robot/cell_papers.h"
#include "server/robot/cell_row.h"
#include "server/robot/cell_rules.h"
#include "server/robot/cell_values_file.h"
#include "server/robot/robot_confirmation.h"

namespace trammel {

Pose read_pose(const YamlMap& map) {
  map.only({"xyz_mm", "q_wxyz"});
  Pose X = Pose::Identity();
  X.translation() = read_vector(map, "xyz_mm") * from_mm(1);
  if (map.has("q_wxyz")) {
    const std::vector<double> v = map.numbers("q_wxyz", 4);
    const Eigen::Quaterniond quaternion(v[0], v[1], v[2], v[3]);
    if (std::abs(quaternion.norm() - 1) > 1e-3) {
      map.refuse("q_wxyz", refused("length {:.6f}, expected a unit quaternion (limit 1e-3)",
                                   quaternion.norm())
                               .beyond(quaternion.norm(), 1));
    }
    X.linear() = quaternion.normalized().toRotationMatrix();
  }
  return X;
}

namespace {

void read_tools(const YamlMap& map, Cell& cell) {
  if (!map.is_null("tools")) {
    const YamlMap tools = map.map("tools");
    for (const std::string& name : tools.keys()) {
      tools.attempt([&] {
        check_key(tools, name, "tool");
        cell.tools[name] = std::nullopt;
        if (!tools.is_null(name)) cell.tools[name] = read_pose(tools.map(name));
      });
    }
  }
  if (cell.tools.empty())
    map.refuse("tools", refused("no tool").beyond(0, 1).next(
                            "name at least one, as null where its pose is unknown"));
}

constexpr double kHeaviest = 2300;  // kg; no robot carries more

void read_payloads(const YamlMap& map, Cell& cell) {
  if (map.is_null("payloads")) return;
  const YamlMap payloads = map.map("payloads");
  for (const std::string& name : payloads.keys()) {
    payloads.attempt([&] {
      check_key(payloads, name, "payload");
      const YamlMap entry = payloads.map(name);
      entry.only({"mass_kg", "cog_mm"});
      Payload payload{entry.number("mass_kg"), read_vector(entry, "cog_mm") * from_mm(1)};
      if (payload.mass < 0) entry.refuse("mass_kg", refused("below 0").beyond(payload.mass, 0));
      if (payload.mass > kHeaviest) {
        entry.refuse("mass_kg", refused("{:g}, limit {:g}", payload.mass, kHeaviest)
                                    .beyond(payload.mass, kHeaviest)
                                    .next("in grams? write it in kg"));
      }
      cell.payloads[name] = payload;
    });
  }
}
bool says_auto(const YamlMap& model) {
  try {
    return model.text("error_sources") == kAutoSources;
  } catch (const YamlRefusal&) {
    return false;
  }
}

/// Lets the measurements choose the bias and the sources beside the named ones.
void leave_to_data(std::vector<std::string> named, ModelSpec& spec) {
  if (!named.empty()) spec.error_sources = named;
  spec.beside_auto = std::move(named);
  spec.bias = kAutoSources;
}

/// A list, or `auto`, alone or in the list; `auto` if the file states nothing.
void read_error_sources(const YamlMap& model, ModelSpec& spec) {
  if (!model.has("error_sources") || says_auto(model)) return leave_to_data({}, spec);
  std::vector<std::string> names = model.texts("error_sources");
  if (std::erase(names, kAutoSources) > 0) return leave_to_data(std::move(names), spec);
  spec.error_sources = std::move(names);
}

void read_model(const YamlMap& map, Cell& cell) {
  if (!map.has("model")) return leave_to_data({}, cell.model);
  const YamlMap model = map.map("model");
  model.only({"error_sources", "bias"});
  model.attempt([&] { read_error_sources(model, cell.model); });
  model.attempt([&] { cell.model.bias = model.text("bias", cell.model.bias); });
}

SessionRule read_sessions(const YamlMap& map) {
  std::string word;
  try {
    word = map.text("sessions");
  } catch (const YamlRefusal&) {
    const YamlMap rule = map.map("sessions");
    rule.only({"last", "days"});
    if (rule.has("last") == rule.has("days"))
      map.refuse("sessions", "expected all, {last: N} or {days: N}");
    const bool last = rule.has("last");
    const char* key = last ? "last" : "days";
    const int count = rule.integer(key, 0);
    if (count < 1) rule.refuse(key, refused("must be 1 or more").beyond(count, 1));
    return {last ? SessionRule::Kind::kLast : SessionRule::Kind::kDays, count};
  }
  if (word != "all")
    map.refuse("sessions",
               refused("'{}', expected all, {{last: N}} or {{days: N}}", word).with_text(word));
  return {};
}

Workspace read_box(const YamlMap& box) {
  box.only({"lower", "upper"});
  const Workspace read{read_vector(box, "lower") * from_mm(1),
                       read_vector(box, "upper") * from_mm(1)};
  for (int k = 0; k < 3; ++k) {
    if (read.lower(k) > read.upper(k))
      box.refuse("lower", refused("{:g} in {}, above upper", to_mm(read.lower(k)), "xyz"[k])
                              .beyond(to_mm(read.lower(k)), to_mm(read.upper(k))));
  }
  return read;
}

void read_surroundings(const YamlMap& map, Cell& cell) {
  map.attempt([&] {
    if (!map.is_null("base")) cell.X_WB = read_pose(map.map("base"));
  });
  map.attempt([&] {
    if (!map.has("gravity")) return;
    cell.gravity_W = read_vector(map, "gravity");
    if (cell.gravity_W.norm() < 1e-9) map.refuse("gravity", "a direction of length 0");
    cell.gravity_W.normalize();
  });
  map.attempt([&] {
    if (map.has("tracker")) cell.tracker = read_tracker(map.map("tracker"));
  });
  map.attempt([&] {
    if (map.has("sessions")) cell.sessions = read_sessions(map);
  });
  map.attempt([&] {
    if (!map.has("step_limit_mm")) return;
    cell.step_limit = from_mm(map.number("step_limit_mm"));
    if (!(*cell.step_limit > 0))
      map.refuse("step_limit_mm", refused("must be above 0").beyond(to_mm(*cell.step_limit), 0));
  });
  map.attempt([&] {
    if (!map.has("workspace_mm")) return;
    cell.workspace = read_box(map.map("workspace_mm"));
  });
}

/// Reads the axes that carry neither robot nor part. An axis that carries the robot is one of its
/// joints.
std::vector<std::string> read_idle_axes(const YamlMap& axes) {
  std::vector<std::string> names = axes.keys();
  for (const std::string& name : names) {
    axes.attempt([&] {
      const std::string carries = axes.text(name);
      if (carries != "carries nothing")
        axes.refuse(
            name,
            refused(
                "'{}', expected carries nothing; a rail that carries the robot is a joint of it",
                carries)
                .with_text(carries));
    });
  }
  return names;
}

CellRules read_rules(const YamlMap& map) {
  CellRules rules;
  map.attempt([&] {
    if (map.is_null("tolerance_mm")) return;
    const double tolerance = map.number("tolerance_mm");
    if (!(tolerance > 0))
      map.refuse("tolerance_mm", refused("expected more than 0").beyond(tolerance, 0));
    rules.tolerance = tolerance * from_mm(1);
  });
  map.attempt([&] {
    if (!map.has("prior")) return;
    const std::string prior = map.text("prior");
    if (prior != "fleet" && prior != "none")
      map.refuse("prior", refused("'{}', expected fleet or none", prior).with_text(prior));
    rules.fleet_prior = prior == "fleet";
  });
  map.attempt([&] { rules.controller_compensates = map.boolean("controller_compensates", false); });
  map.attempt([&] {
    if (!map.is_null("axes")) rules.idle_axes = read_idle_axes(map.map("axes"));
  });
  return rules;
}

/// `links`: the robot's joints; the radii are of their links and of the tool.
std::optional<Obstacles> read_obstacles(const YamlMap& cell, int links) {
  if (cell.is_null("obstacles")) return std::nullopt;
  const YamlMap map = cell.map("obstacles");
  map.only({"floor_mm", "mounting", "boxes", "link_radii_mm"});
  Obstacles around;
  map.attempt([&] {
    if (!map.is_null("floor_mm")) around.floor = map.number("floor_mm") * from_mm(1);
  });
  map.attempt([&] {
    if (!map.is_null("mounting"))
      around.boxes.push_back({"the mounting", read_box(map.map("mounting")), true});
  });
  map.attempt([&] {
    if (map.is_null("boxes")) return;
    const YamlMap boxes = map.map("boxes");
    for (const std::string& name : boxes.keys())
      boxes.attempt([&] { around.boxes.push_back({name, read_box(boxes.map(name)), false}); });
  });
  map.attempt([&] {
    if (map.is_null("link_radii_mm")) return;
    for (const double mm : map.numbers("link_radii_mm", static_cast<std::size_t>(links) + 1)) {
      if (!(mm >= 0)) map.refuse("link_radii_mm", refused("{:g}, below 0", mm).beyond(mm, 0));
      around.link_radius.push_back(mm * from_mm(1));
    }
  });
  return around;
}

CellPapers read_papers(const YamlMap& map) {
  CellPapers papers;
  const auto read = [&](const char* key, std::string* text) {
    map.attempt([&] {
      if (!map.is_null(key)) *text = map.text(key);
    });
  };
  read("serial_number", &papers.serial_number);
  read("instrument", &papers.instrument);
  read("instrument_certificate", &papers.instrument_certificate);
  read("operator", &papers.operator_name);
  return papers;
}

std::optional<RobotConfirmation> read_confirmation(const YamlMap& map) {
  if (map.is_null("robot_confirmed")) return std::nullopt;
  const YamlMap said = map.map("robot_confirmed");
  said.only({"robot_sha256", "poses", "position_mm", "orientation_deg", "day"});
  return RobotConfirmation{said.text("robot_sha256"), said.integer("poses", 0),
                           said.number("position_mm"), said.number("orientation_deg"),
                           said.text("day")};
}

Cell read_cell_map(const YamlMap& map) {
  map.only({"version",
            "cell",
            "robot",
            "base",
            "gravity",
            "tools",
            "payloads",
            "tracker",
            "model",
            "joint_ranges_deg",
            "workspace_mm",
            "sessions",
            "tolerance_mm",
            "step_limit_mm",
            "prior",
            "controller_compensates",
            "anchors",
            "serial_number",
            "instrument",
            "operator",
            "robot_confirmed",
            "axes",
            "instrument_certificate",
            "obstacles"});
  Cell cell;
  map.attempt([&] {
    if (map.integer("version", 0) != 1)
      map.refuse("version", refused("expected 1").beyond(map.integer("version", 0), 1));
  });
  map.attempt([&] {
    cell.name = map.text("cell");
    if (cell.name.empty() || cell.name.find_first_of("@/ \t") != std::string::npos) {
      map.refuse("cell", refused("'{}', expected a name without blanks, '@' and '/'", cell.name)
                             .with_text(cell.name));
    }
    if (const Status fine = check_name(cell.name, "cell"); !fine)
      map.refuse("cell", Failure(fine.error()));
  });
  read_surroundings(map, cell);
  map.attempt([&] { read_tools(map, cell); });
  map.attempt([&] { read_payloads(map, cell); });
  map.attempt([&] { static_cast<void>(read_anchors(map)); });
  map.attempt([&] { read_model(map, cell); });
  static_cast<void>(read_rules(map));
  static_cast<void>(read_papers(map));
  map.attempt([&] { static_cast<void>(read_confirmation(map)); });
  return cell;
}

void read_joint_ranges(const YamlMap& map, Cell& cell) {
  if (map.is_null("joint_ranges_deg")) return;
  const YamlMap ranges = map.map("joint_ranges_deg");
  for (int i = 0; i < cell.robot.size(); ++i) {
    const std::vector<double> range = ranges.numbers(fmt::format("q{}", i + 1), 2);
    if (!(range[0] <= range[1])) {
      ranges.refuse(fmt::format("q{}", i + 1),
                    refused("lower end above upper end").beyond(range[0], range[1]));
    };
    cell.joint_ranges.emplace_back(from_deg(range[0]), from_deg(range[1]));
  }
  if (ranges.keys().size() != static_cast<std::size_t>(cell.robot.size())) {
    ranges.refuse("q1...", refused("expected {} joints", cell.robot.size())
                               .beyond(ranges.keys().size(), cell.robot.size()));
  }
}
}  // namespace

namespace {

/// Reads the cell even if its robot was refused, so that all errors of the cell file are reported.
Result<Cell> cell_with(const Result<Chain>& robot, const std::string& cell_yaml,
                       const std::string& where) {
  return read_yaml(cell_yaml, where, [&](const YamlMap& map) {
    Cell cell = read_cell_map(map);
    if (!robot) throw YamlRefusal{robot.error()};
    cell.robot = *robot;
    map.attempt([&] { read_joint_ranges(map, cell); });
    static_cast<void>(read_obstacles(map, cell.robot.size()));
    cell.cell_yaml = cell_yaml;
    return cell;
  });
}

/// The text of a file that another file names. Refuses a pipe, since a user would not expect the
/// program to wait there.
Result<std::string> file_text_of(const std::string& path) {
  std::error_code unknown;
  if (std::filesystem::exists(path, unknown) && !std::filesystem::is_regular_file(path, unknown))
    return refused("no file, but a pipe, a device or a folder").in(path);
  return read_text_file(path);
}

/// The path of the robot file that the cell names, relative to the cell file.
Result<std::string> robot_path_in(const std::string& cell_yaml, const std::string& path) {
  return read_yaml(cell_yaml, path, [](const YamlMap& map) { return map.text("robot"); })
      .map([&](const std::string& name) {
        return (std::filesystem::path(path).parent_path() / name).string();
      });
}

/// The text of the robot file that the cell names.
Result<std::string> robot_text_of(const std::string& cell_yaml, const std::string& path,
                                  std::string& robot_path) {
  const std::string found = TRY(robot_path_in(cell_yaml, path));
  robot_path = found;
  return file_text_of(robot_path).map_error([&](Error error) {
    return Failure(std::move(error))
        .of("robot")
        .next(fmt::format("{} names it as its robot", path))
        .value();
  });
}

}  // namespace

Result<std::string> robot_path_of(const std::string& path) {
  return file_text_of(path).and_then(
      [&](const std::string& text) { return robot_path_in(text, path); });
}

std::optional<long> row_of_model_key(const Cell& cell, const std::string& key) {
  const auto row = read_yaml(cell.cell_yaml, cell.name, [&](const YamlMap& map) {
    return map.has("model") ? map.map("model").row_of(key) : std::nullopt;
  });
  return row ? *row : std::nullopt;
}

Result<CellRules> rules_of(const Cell& cell) {
  if (cell.cell_yaml.empty()) return CellRules{};
  return read_yaml(cell.cell_yaml, cell.name, [](const YamlMap& map) { return read_rules(map); });
}

Result<CellPapers> papers_of(const Cell& cell) {
  if (cell.cell_yaml.empty()) return CellPapers{};
  return read_yaml(cell.cell_yaml, cell.name, [](const YamlMap& map) { return read_papers(map); });
}

Result<std::optional<Obstacles>> obstacles_of(const Cell& cell) {
  if (cell.cell_yaml.empty()) return std::optional<Obstacles>();
  return read_yaml(cell.cell_yaml, cell.name,
                   [&](const YamlMap& map) { return read_obstacles(map, cell.robot.size()); });
}

std::optional<RobotConfirmation> confirmation_of(const Cell& cell) {
  if (cell.cell_yaml.empty()) return std::nullopt;
  const auto said = read_yaml(cell.cell_yaml, cell.name,
                              [](const YamlMap& map) { return read_confirmation(map); });
  if (!said || !*said || (*said)->robot_sha256 != sha256_hex(cell.robot_yaml)) return std::nullopt;
  return *said;
}

Result<Anchors> anchors_of(const Cell& cell) {
  if (cell.cell_yaml.empty()) return Anchors{};
  return read_yaml(cell.cell_yaml, cell.name, [](const YamlMap& map) { return read_anchors(map); });
}

Result<Cell> parse_cell(const std::string& cell_yaml, const std::string& robot_yaml,
                        const std::string& where) {
  Result<Cell> cell = cell_with(parse_robot(robot_yaml, where + " (robot)"), cell_yaml, where);
  if (cell) cell->robot_yaml = robot_yaml;
  return cell;
}

Result<Cell> read_cell(const std::string& path) {
  const std::string cell_yaml = TRY(read_text_file(path));
  std::string robot_path;
  const Result<std::string> robot_yaml = robot_text_of(cell_yaml, path, robot_path);
  const Result<Chain> robot =
      robot_yaml.and_then([&](const std::string& text) { return parse_robot(text, robot_path); });
  Result<Cell> cell = cell_with(robot, cell_yaml, path);
  if (cell) cell->robot_yaml = *robot_yaml;
  return cell;
}

namespace {

template <typename Map>
Result<std::string> resolve(const Map& known, const std::string& requested, const std::string& cell,
                            const char* kind) {
  std::string names;
  for (const auto& [name, value] : known) names += (names.empty() ? "" : ", ") + name;
  if (requested.empty()) {
    if (known.size() == 1) return known.begin()->first;
    return refused("cell {}: no {} named, and the cell has {}: {}", cell, kind, known.size(), names)
        .of(fmt::format("{}_id", kind));
  }
  if (!known.contains(requested)) {
    return refused("cell {}: unknown {} '{}'", cell, kind, requested)
        .of(fmt::format("{}_id", kind))
        .with_text(requested)
        .next(fmt::format("known: {}", names.empty() ? "none" : names));
  }
  return requested;
}

}  // namespace

Result<std::string> resolve_tool(const Cell& cell, const std::string& requested) {
  return resolve(cell.tools, requested, cell.name, "tool");
}

Result<std::string> resolve_payload(const Cell& cell, const std::string& requested) {
  if (cell.payloads.empty() && requested.empty()) return std::string();
  return resolve(cell.payloads, requested, cell.name, "payload");
}

}  // namespace trammel
