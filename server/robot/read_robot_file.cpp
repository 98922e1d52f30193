#include <cmath>

#include "server/base/text_file.h"
#include "server/base/units.h"
#include "server/base/yaml_file.h"
#include "server/robot/cell.h"
#include "server/robot/cell_values_file.h"
#include "server/robot/joint_pulses.h"
#include "server/robot/smallest_step.h"

/// The robot file: joints, links, limits, and which joints follow others.
namespace trammel {

namespace {

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

constexpr double kCoarsestMm = 50;   // of a robot's repeatability: no arm is worse
constexpr double kCoarsestStep = 1;  // of an encoder, deg, mm

/// A number above 0 and at most `most`, in the unit of the key.
double read_step(const YamlMap& map, const std::string& key, double most) {
  const double step = map.number(key);
  if (!(step > 0)) map.refuse(key, refused("must be above 0").beyond(step, 0));
  if (step > most) map.refuse(key, refused("{:g}, limit {:g}", step, most).beyond(step, most));
  return step;
}

/// rad (m); 0: not stated.
double encoder_step(const YamlMap& joint) {
  for (const auto& [key, unit] :
       {std::pair("encoder_resolution_deg", from_deg(1)), {"encoder_resolution_mm", from_mm(1)}}) {
    if (joint.has(key)) return unit * read_step(joint, key, kCoarsestStep);
  }
  return 0;
}

ArmSteps read_steps(const YamlMap& robot) {
  ArmSteps steps;
  if (robot.has("repeatability_mm"))
    steps.repeatability = from_mm(read_step(robot, "repeatability_mm", kCoarsestMm));
  for (const YamlMap& joint : robot.maps("joints")) steps.encoders.push_back(encoder_step(joint));
  return steps;
}

constexpr double kFewestPulses = 1e-3, kMostPulses = 1e7;  // of a degree

/// Of all joints or of none, since a pulse that is not told leaves the whole target.
std::vector<double> read_pulses(const YamlMap& robot) {
  std::vector<double> pulses;
  const std::vector<YamlMap> joints = robot.maps("joints");
  for (const YamlMap& joint : joints) {
    if (!joint.has("pulses_per_deg")) continue;
    if (joint.text("type", "revolute") != "revolute")
      joint.refuse("pulses_per_deg", "not of this type of joint");
    const double number = joint.number("pulses_per_deg");
    if (!(std::abs(number) >= kFewestPulses && std::abs(number) <= kMostPulses))
      joint.refuse("pulses_per_deg", refused("{:g}, expected {:g} to {:g}, with its sign", number,
                                             kFewestPulses, kMostPulses));
    pulses.push_back(number);
  }
  if (!pulses.empty() && pulses.size() != joints.size())
    robot.refuse("joints", refused("{} of {} joints have pulses_per_deg, expected all or none",
                                   pulses.size(), joints.size()));
  return pulses;
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
  const std::string of_others = revolute ? "encoder_resolution_mm" : "encoder_resolution_deg";
  if (map.has(of_others)) map.refuse(of_others, "not of this type of joint");
  if (!map.boolean("passive", false)) return;
  if (map.has(limits)) map.refuse(limits, "a passive joint is never commanded and has no limits");
  joint.lower = joint.upper = 0;
}

Joint read_joint(const YamlMap& map) {
  map.only({"type",
            "theta_deg",
            "d_mm",
            "a_mm",
            "alpha_deg",
            "beta_deg",
            "hayati",
            "limits_deg",
            "limits_mm",
            "sign",
            "gear_ratio",
            "compliance_rad_per_nmm",
            "mass_kg",
            "cog_mm",
            "max_speed_deg_s",
            "max_speed_mm_s",
            "passive",
            "encoder_resolution_deg",
            "encoder_resolution_mm",
            "pulses_per_deg"});
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

constexpr double kShortestArm = 0.05;  // m, all lengths of its links together; every robot is
                                       // larger

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
               map.only({"version", "name", "source", "joints", "coupling", "repeatability_mm"});
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
               map.attempt([&] { read_steps(map); });
               map.attempt([&] { read_pulses(map); });
               return Chain::make(map.text("name"), std::move(joints), std::move(couplings));
             })
      .and_then([](Result<Chain> chain) { return chain; })
      .map_error([&](Error error) { return Failure(std::move(error)).in(where).value(); });
}

Result<Chain> read_robot(const std::string& path) {
  return read_text_file(path).and_then(
      [&](const std::string& text) { return parse_robot(text, path); });
}

Result<ArmSteps> steps_of(const Cell& cell) {
  if (cell.robot_yaml.empty()) return ArmSteps{};
  return read_yaml(cell.robot_yaml, cell.name, [](const YamlMap& map) { return read_steps(map); });
}

Result<std::vector<double>> joint_pulses(const Cell& cell) {
  if (cell.robot_yaml.empty()) return std::vector<double>{};
  return read_yaml(cell.robot_yaml, cell.name, [](const YamlMap& map) { return read_pulses(map); });
}

}  // namespace trammel
