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
#include "server/robot/cell_papers.h"
#include "server/robot/cell_row.h"
#include "server/robot/cell_rules.h"
#include "server/robot/gauge.h"
#include "server/robot/robot_confirmation.h"

namespace trammel {

namespace {

constexpr double kFarthestMm = 1e9;  // of any frame or point: no cell is larger

Vector3 read_vector(const YamlMap& map, const std::string& key) {
  const std::vector<double> v = map.numbers(key, 3);
  for (const double value : v) {
    if (std::abs(value) > kFarthestMm)
      map.refuse(key, refused("{:g}, limit {:g}", value, kFarthestMm).beyond(value, kFarthestMm));
  }
  return {v[0], v[1], v[2]};
}

/// The name of a tool or a payload, as ids in requests have it.
void check_key(const YamlMap& map, const std::string& name, const char* what) {
  if (name.empty()) map.refuse(name, refused("a {} without a name", what));
  if (const Status fine = check_name(name, what); !fine) map.refuse(name, Failure(fine.error()));
}

void read_link(const YamlMap& map, Joint& joint) {
  joint.hayati = map.boolean("hayati", false);
  if (joint.hayati && map.number("d_mm", 0) != 0) map.refuse("d_mm", "a Hayati link has no d");
  if (!joint.hayati && map.has("beta_deg")) map.refuse("beta_deg", "only a Hayati link has beta");
  joint.link.theta = from_deg(map.number("theta_deg", 0));
  joint.link.d = from_mm(map.number("d_mm", 0));
  joint.link.a = from_mm(map.number("a_mm", 0));
  joint.link.alpha = from_deg(map.number("alpha_deg", 0));
  joint.link.beta = from_deg(map.number("beta_deg", 0));
}

/// Reads the limits and the speed of the joint.
void read_motion(const YamlMap& map, Joint& joint) {
  const bool revolute = joint.type == JointType::kRevolute;
  const std::string limits = revolute ? "limits_deg" : "limits_mm";
  const char* unit = revolute ? "deg" : "mm";
  const std::string speed = revolute ? "max_speed_deg_s" : "max_speed_mm_s";
  const auto si = [&](double value) { return revolute ? from_deg(value) : from_mm(value); };
  if (map.has(limits)) {
    const std::vector<double> range = map.numbers(limits, 2);
    if (!(range[0] < range[1])) {
      map.refuse(limits, refused("lower limit {:g} {} is not below upper limit {:g} {}", range[0],
                                 unit, range[1], unit)
                             .beyond(range[0], range[1])
                             .next("where nobody commands the joint, write passive: true"));
    }
    joint.lower = si(range[0]);
    joint.upper = si(range[1]);
  }
  if (map.has(speed)) joint.max_speed = si(map.number(speed));
  if (!map.boolean("passive", false)) return;
  if (map.has(limits)) map.refuse(limits, "a passive joint is never commanded and has no limits");
  joint.lower = joint.upper = 0;
}

Joint read_joint(const YamlMap& map) {
  map.only({"type", "theta_deg", "d_mm", "a_mm", "alpha_deg", "beta_deg", "hayati", "limits_deg",
            "limits_mm", "sign", "gear_ratio", "compliance_rad_per_nmm", "mass_kg", "cog_mm",
            "max_speed_deg_s", "max_speed_mm_s", "passive"});
  Joint joint;
  map.attempt([&] {
    const std::string type = map.text("type", "revolute");
    if (type != "revolute" && type != "prismatic")
      map.refuse("type", refused("'{}', expected revolute or prismatic", type).with_text(type));
    joint.type = type == "revolute" ? JointType::kRevolute : JointType::kPrismatic;
  });
  map.attempt([&] { read_link(map, joint); });
  map.attempt([&] {
    joint.sign = map.number("sign", 1);
    joint.gear_ratio = map.number("gear_ratio", 0);
    joint.compliance_prior = from_rad_per_nmm(map.number("compliance_rad_per_nmm", 0));
    joint.mass = map.number("mass_kg", 0);
    if (joint.mass < 0) map.refuse("mass_kg", refused("below 0").beyond(joint.mass, 0));
    if (map.has("cog_mm")) joint.p_cog = read_vector(map, "cog_mm") * from_mm(1);
  });
  map.attempt([&] { read_motion(map, joint); });
  return joint;
}

}  // namespace

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

constexpr double kWorstSigma = 5e-3;  // m; no instrument for robots is worse

Tracker read_tracker(const YamlMap& map) {
  map.only({"sigma_mm", "sigma_deg", "xyz_mm", "aperture_deg", "target_normal"});
  Tracker tracker;
  tracker.sigma = from_mm(map.number("sigma_mm", to_mm(tracker.sigma)));
  tracker.sigma_rotation = from_deg(map.number("sigma_deg", to_deg(tracker.sigma_rotation)));
  if (tracker.sigma <= 0)
    map.refuse("sigma_mm", refused("must be above 0").beyond(to_mm(tracker.sigma), 0));
  if (tracker.sigma > kWorstSigma) {
    map.refuse("sigma_mm", refused("{:g}, limit {:g}", to_mm(tracker.sigma), to_mm(kWorstSigma))
                               .beyond(to_mm(tracker.sigma), to_mm(kWorstSigma))
                               .next("in micrometres? write it in mm"));
  }
  if (tracker.sigma_rotation <= 0)
    map.refuse("sigma_deg", refused("must be above 0").beyond(to_deg(tracker.sigma_rotation), 0));
  if (!map.is_null("xyz_mm")) tracker.p_W = read_vector(map, "xyz_mm") * from_mm(1);
  if (map.has("aperture_deg")) {
    tracker.aperture = from_deg(map.number("aperture_deg"));
    if (!(*tracker.aperture > 0 && *tracker.aperture <= kPi))
      map.refuse("aperture_deg",
                 refused("must be above 0, at most 180")
                     .beyond(to_deg(*tracker.aperture), *tracker.aperture > 0 ? 180 : 0));
  }
  if (map.has("target_normal")) {
    tracker.target_normal_T = read_vector(map, "target_normal");
    if (tracker.target_normal_T.norm() < 1e-9)
      map.refuse("target_normal", "a direction of length 0");
    tracker.target_normal_T.normalize();
  }
  return tracker;
}

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

/// A direction of length 1.
Vector3 read_direction(const YamlMap& map, const std::string& key) {
  const Vector3 direction = read_vector(map, key);
  if (direction.norm() < 1e-9) map.refuse(key, "a direction of length 0");
  return direction.normalized();
}

double read_radius(const YamlMap& map, const std::string& key) {
  const double radius = map.number(key);
  if (!(radius > 0)) map.refuse(key, refused("must be above 0").beyond(radius, 0));
  return from_mm(radius);
}

/// The shape of an anchor: a point, unless a key says that it is a sphere, a plane or a ring.
void read_shape(const YamlMap& map, Anchor& anchor) {
  const bool sphere = map.has("sphere_radius_mm"), plane = map.has("plane_normal"),
             ring = map.has("ring_axis");
  if (sphere + plane + ring > 1)
    map.refuse(plane ? "plane_normal" : "ring_axis", "an anchor is one of sphere, plane and ring");
  if (ring != map.has("ring_radius_mm"))
    map.refuse("ring_radius_mm", "ring_axis and ring_radius_mm belong together");
  if (sphere) {
    anchor.shape = Anchor::Shape::kSphere;
    anchor.radius = read_radius(map, "sphere_radius_mm");
  } else if (plane) {
    anchor.shape = Anchor::Shape::kPlane;
    anchor.direction_W = read_direction(map, "plane_normal");
  } else if (ring) {
    anchor.shape = Anchor::Shape::kRing;
    anchor.direction_W = read_direction(map, "ring_axis");
    anchor.radius = read_radius(map, "ring_radius_mm");
  }
  if ((plane || ring) && !anchor.p_W)
    map.refuse("xyz_mm", "where a plane or a ring is must be known");
}

Anchor read_anchor(const YamlMap& map) {
  map.only({"xyz_mm", "zero_mm", "sigma_mm", "sphere_radius_mm", "plane_normal", "ring_axis",
            "ring_radius_mm"});
  Anchor anchor;
  if (!map.is_null("xyz_mm")) anchor.p_W = read_vector(map, "xyz_mm") * from_mm(1);
  if (!map.is_null("zero_mm")) anchor.zero = from_mm(map.number("zero_mm"));
  anchor.zero_open = map.has("zero_mm") && map.is_null("zero_mm");
  if (!map.is_null("sigma_mm")) {
    const double sigma = map.number("sigma_mm");
    if (!(sigma > 0)) map.refuse("sigma_mm", refused("must be above 0").beyond(sigma, 0));
    anchor.sigma = from_mm(sigma);
  }
  read_shape(map, anchor);
  return anchor;
}

Anchors read_anchors(const YamlMap& map) {
  Anchors all;
  if (map.is_null("anchors")) return all;
  const YamlMap anchors = map.map("anchors");
  for (const std::string& name : anchors.keys()) {
    anchors.attempt([&] {
      check_key(anchors, name, "anchor");
      all[name] = anchors.is_null(name) ? Anchor{} : read_anchor(anchors.map(name));
    });
  }
  return all;
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

/// A list, or `auto`, alone or in the list; `auto` where nothing is said.
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
    const YamlMap box = map.map("workspace_mm");
    box.only({"lower", "upper"});
    cell.workspace =
        Workspace{read_vector(box, "lower") * from_mm(1), read_vector(box, "upper") * from_mm(1)};
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

CellPapers read_papers(const YamlMap& map) {
  CellPapers papers;
  const auto read = [&](const char* key, std::string* text) {
    map.attempt([&] {
      if (!map.is_null(key)) *text = map.text(key);
    });
  };
  read("serial_number", &papers.serial_number);
  read("instrument", &papers.instrument);
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
  map.only({"version",         "cell",
            "robot",           "base",
            "gravity",         "tools",
            "payloads",        "tracker",
            "model",           "joint_ranges_deg",
            "workspace_mm",    "sessions",
            "tolerance_mm",    "step_limit_mm",
            "prior",           "controller_compensates",
            "anchors",         "serial_number",
            "instrument",      "operator",
            "robot_confirmed", "axes"});
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

/// The index from 0 of a joint that the file counts from 1. Chain::make() checks that the robot has
/// it.
int joint_index(const YamlMap& map, const std::string& key) {
  const int number = map.integer(key, 0);
  if (number < 1 || number > kMaxJoints)
    map.refuse(key, refused("{}, limit 1 to {}", number, kMaxJoints)
                        .beyond(number, number < 1 ? 1 : kMaxJoints));
  return number - 1;
}

CouplingKind coupling_kind(const YamlMap& map) {
  const std::string text = map.text("kind", to_string(CouplingKind::kController));
  for (const CouplingKind kind : {CouplingKind::kController, CouplingKind::kParallelogram})
    if (text == to_string(kind)) return kind;
  map.refuse("kind", refused("'{}', expected controller or parallelogram", text).with_text(text));
}

}  // namespace

namespace {

constexpr double kShortestArm = 0.05;  // m, all lengths of its links together; no robot is smaller

/// Refuses an arm that is smaller than any robot.
void check_lengths(const YamlMap& map, const std::vector<Joint>& joints) {
  double sum = 0;
  bool rails = false;
  for (const Joint& joint : joints) {
    sum += std::abs(joint.link.a) + std::abs(joint.link.d);
    rails = rails || joint.type == JointType::kPrismatic;
  }
  if (rails || joints.size() < 3 || sum >= kShortestArm) return;
  map.refuse("joints",
             refused("all lengths of the links together are {:g} mm, expected {:g} or more",
                     to_mm(sum), to_mm(kShortestArm))
                 .beyond(to_mm(sum), to_mm(kShortestArm))
                 .next("in metres? write them in mm"));
}

}  // namespace

Result<Chain> parse_robot(const std::string& robot_yaml, const std::string& where) {
  return read_yaml(
             robot_yaml, where,
             [&](const YamlMap& map) {
               map.only({"version", "name", "source", "joints", "coupling"});
               if (map.integer("version", 0) != 1)
                 map.refuse("version", refused("expected 1").beyond(map.integer("version", 0), 1));
               std::vector<Joint> joints;
               for (const YamlMap& entry : map.maps("joints")) joints.push_back(read_joint(entry));
               map.attempt([&] { check_lengths(map, joints); });
               std::vector<Coupling> couplings;
               if (!map.is_null("coupling")) {
                 for (const YamlMap& entry : map.maps("coupling")) {
                   entry.only({"joint", "follows", "ratio", "kind"});
                   couplings.push_back({joint_index(entry, "joint"), joint_index(entry, "follows"),
                                        entry.number("ratio"), coupling_kind(entry)});
                 }
               }
               return Chain::make(map.text("name"), std::move(joints), std::move(couplings));
             })
      .and_then([](Result<Chain> chain) { return chain; })
      .map_error([&](Error error) { return Failure(std::move(error)).in(where).value(); });
}

Result<Chain> read_robot(const std::string& path) {
  return read_text_file(path).and_then(
      [&](const std::string& text) { return parse_robot(text, path); });
}

namespace {

/// Reads the cell even if its robot was refused, so that all errors of the cell file are reported.
Result<Cell> cell_with(const Result<Chain>& robot, const std::string& cell_yaml,
                       const std::string& where) {
  return read_yaml(cell_yaml, where, [&](const YamlMap& map) {
    Cell cell = read_cell_map(map);
    if (!robot) throw YamlRefusal{robot.error()};
    cell.robot = *robot;
    map.attempt([&] { read_joint_ranges(map, cell); });
    cell.cell_yaml = cell_yaml;
    return cell;
  });
}

/// The text of a file that another file names. Refuses a pipe: whoever starts a program does not
/// know that it would wait there.
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
