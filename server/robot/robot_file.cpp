#include "server/robot/robot_file.h"

#include <fmt/format.h>

#include <cmath>

#include "server/base/plain_text.h"
#include "server/base/units.h"
#include "server/robot/passive_joint.h"

namespace trammel {

namespace {

std::string link_yaml(const Joint& own, const LinkGeometry& link) {
  std::string text = own.type == JointType::kPrismatic ? "type: prismatic, " : "";
  text += fmt::format("theta_deg: {:.15g}, ", to_deg(link.theta));
  if (!own.hayati) text += fmt::format("d_mm: {:.15g}, ", to_mm(link.d));
  text += fmt::format("a_mm: {:.15g}, alpha_deg: {:.15g}", to_mm(link.a), to_deg(link.alpha));
  if (own.hayati) text += fmt::format(", beta_deg: {:.15g}, hayati: true", to_deg(link.beta));
  return text;
}

std::string motion_yaml(const Joint& own) {
  const bool rail = own.type == JointType::kPrismatic;
  std::string text = own.sign < 0 ? ", sign: -1" : "";
  if (is_passive(own)) {
    text += ", passive: true";
  } else if (std::isfinite(own.lower) && std::isfinite(own.upper)) {
    text += fmt::format(", limits_{}: [{:.12g}, {:.12g}]", rail ? "mm" : "deg",
                        rail ? to_mm(own.lower) : to_deg(own.lower),
                        rail ? to_mm(own.upper) : to_deg(own.upper));
  }
  if (own.gear_ratio != 0) text += fmt::format(", gear_ratio: {:.12g}", own.gear_ratio);
  if (own.max_speed) {
    text += fmt::format(", max_speed_{}_s: {:.12g}", rail ? "mm" : "deg",
                        rail ? to_mm(*own.max_speed) : to_deg(*own.max_speed));
  }
  return text;
}

std::string load_yaml(const Joint& own) {
  std::string text;
  if (own.compliance_prior != 0)
    text += fmt::format(", compliance_rad_per_nmm: {:.12g}", to_rad_per_nmm(own.compliance_prior));
  if (own.mass != 0) {
    const Vector3 cog = own.p_cog * to_mm(1);
    text += fmt::format(", mass_kg: {:.12g}, cog_mm: [{:.12g}, {:.12g}, {:.12g}]", own.mass,
                        cog.x(), cog.y(), cog.z());
  }
  return text;
}

/// A text in single quotes.
std::string yaml_text(const std::string& text) {
  std::string quoted;
  for (const char c : shown(text)) quoted += c == '\'' ? "''" : std::string(1, c);
  return "'" + quoted + "'";
}

}  // namespace

std::string joints_yaml(const Chain& robot, const std::vector<LinkGeometry>& links) {
  std::string text = "joints:\n";
  for (int j = 0; j < robot.size(); ++j) {
    const Joint& own = robot.joint(j);
    text += "  - {" + link_yaml(own, links[static_cast<std::size_t>(j)]) + motion_yaml(own) +
            load_yaml(own) + "}\n";
  }
  if (!robot.couplings().empty()) text += "coupling:\n";
  for (const Coupling& one : robot.couplings()) {
    text += fmt::format("  - {{joint: {}, follows: {}, ratio: {:.15g}, kind: {}}}\n", one.joint + 1,
                        one.follows + 1, one.ratio, to_string(one.kind));
  }
  return text;
}

std::string robot_yaml(const Chain& robot, const std::string& source) {
  std::vector<LinkGeometry> links;
  for (int j = 0; j < robot.size(); ++j) links.push_back(robot.joint(j).link);
  return fmt::format("version: 1\nname: {}\nsource: {}\n", yaml_text(robot.name()),
                     yaml_text(source)) +
         joints_yaml(robot, links);
}

}  // namespace trammel
