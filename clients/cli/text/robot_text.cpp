#include "clients/cli/text/robot_text.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "server/base/plain_text.h"
#include "server/base/units.h"
#include "server/compensate/model_notes.h"
#include "server/measurement/files/csv_table.h"
#include "server/report/note_json.h"
#include "server/robot/robot_file.h"

namespace trammel::cli {

namespace {

std::string xml(const std::string& text) {
  std::string safe;
  for (const char c : shown(text)) {
    const std::string_view special = c == '<'   ? "&lt;"
                                     : c == '>' ? "&gt;"
                                     : c == '&' ? "&amp;"
                                     : c == '"' ? "&quot;"
                                                : "";
    safe += special.empty() ? std::string(1, c) : std::string(special);
  }
  return safe;
}

/// A comment may not hold two hyphens.
std::string xml_comment(std::string text) {
  for (auto at = text.find("--"); at != std::string::npos; at = text.find("--", at))
    text.replace(at, 2, "- -");
  return text;
}

std::string origin(const Pose& X) {
  const Vector3 p = X.translation() + Vector3::Zero();  // no -0
  const Vector3 yaw_pitch_roll = zyx_angles(X.linear()) + Vector3::Zero();
  return fmt::format("<origin xyz=\"{:.15g} {:.15g} {:.15g}\" rpy=\"{:.15g} {:.15g} {:.15g}\"/>",
                     p.x(), p.y(), p.z(), yaw_pitch_roll.z(), yaw_pitch_roll.y(),
                     yaw_pitch_roll.x());
}

std::string joint(const std::string& name, const std::string& type, const std::string& parent,
                  const std::string& child, const Pose& X, const std::string& inside = "") {
  return fmt::format(
      "  <link name=\"{3}\"/>\n  <joint name=\"{0}\" type=\"{1}\">\n    <parent link=\"{2}\"/>\n   "
      " <child link=\"{3}\"/>\n    {4}\n{5}  </joint>\n",
      name, type, parent, child, origin(X), inside);
}

Pose turned(int axis, double angle) {
  return make_pose(rotation_exp(angle * Vector3::Unit(axis)), Vector3::Zero());
}

/// The transforms to the joint's axis, and from there to the end of the link.
Pose before_axis(const LinkGeometry& link) {
  Pose X = turned(2, link.theta);
  X.translation() = Vector3(0, 0, link.d);
  return X;
}
Pose behind_axis(const LinkGeometry& link) {
  return make_pose(Matrix3::Identity(), Vector3(link.a, 0, 0)) * turned(0, link.alpha) *
         turned(1, link.beta);
}

std::string limits(const Joint& joint) {
  return fmt::format(
      "    <limit lower=\"{:.15g}\" upper=\"{:.15g}\" effort=\"0\" velocity=\"{:.15g}\"/>\n",
      joint.lower, joint.upper, joint.max_speed.value_or(0));
}

/// The joints of one axis of the chain: its own, then one for each joint that it follows.
std::string axis_joints(const Chain& chain, int j, const std::string& parent, const Pose& X,
                        const std::string& child) {
  const Joint& own = chain.joint(j);
  const bool bounded = std::isfinite(own.lower) && std::isfinite(own.upper);
  const std::string type = own.type == JointType::kPrismatic ? "prismatic"
                           : bounded                         ? "revolute"
                                                             : "continuous";
  std::vector<int> followed;
  for (int k = 0; k < chain.size(); ++k) {
    if (k != j && chain.transmission()(j, k) != 0) followed.push_back(k);
  }
  const std::string axis =
      fmt::format("    <axis xyz=\"0 0 {:g}\"/>\n", chain.transmission()(j, j) < 0 ? -1.0 : 1.0);
  const auto link_of = [&](std::size_t k) {
    return k == followed.size() ? child : fmt::format("{}_follows_{}", child, followed[k] + 1);
  };
  std::string text = joint(fmt::format("joint_{}", j + 1), type, parent, link_of(0), X,
                           axis + (type == "continuous" ? "" : limits(own)));
  for (std::size_t k = 0; k < followed.size(); ++k) {
    const Joint& leader = chain.joint(followed[k]);
    const double ratio = chain.transmission()(j, followed[k]);
    Joint range;  // of the joints that it adds
    range.lower = std::min(ratio * leader.lower, ratio * leader.upper);
    range.upper = std::max(ratio * leader.lower, ratio * leader.upper);
    const bool free = !std::isfinite(range.lower) || !std::isfinite(range.upper);
    text += joint(
        fmt::format("joint_{}_follows_{}", j + 1, followed[k] + 1),
        own.type == JointType::kPrismatic ? "prismatic"
        : free                            ? "continuous"
                                          : "revolute",
        link_of(k), link_of(k + 1), Pose::Identity(),
        fmt::format(
            "    <axis xyz=\"0 0 1\"/>\n{}    <mimic joint=\"joint_{}\" multiplier=\"{:.15g}\"/>\n",
            free ? "" : limits(range), followed[k] + 1, ratio));
  }
  return text;
}

/// A name for a link: letters, digits and underscores.
std::string link_name(const std::string& name) {
  std::string safe;
  for (const char c : name) safe += std::isalnum(static_cast<unsigned char>(c)) != 0 ? c : '_';
  return safe;
}

std::string pose_yaml(const Pose& X) {
  const Eigen::Quaterniond q(X.linear());
  const Vector3 p = X.translation() * to_mm(1);
  return fmt::format(
      "{{xyz_mm: [{:.12g}, {:.12g}, {:.12g}], q_wxyz: [{:.15g}, {:.15g}, {:.15g}, {:.15g}]}}",
      p.x(), p.y(), p.z(), q.w(), q.x(), q.y(), q.z());
}

/// Two standard uncertainties of the parameter that calibration calls `name`; empty where it
/// identified none.
std::string u95_of(const CompensatedModel& model, const std::string& name) {
  for (const IdentifiedParameter& one : model.parts().parameters) {
    if (one.parameter.name != name || !one.identified) continue;
    const double people = one.parameter.unit == "rad" ? to_deg(1) : one.parameter.scale;
    return fmt::format("{:.6g}", 2 * one.stddev * people);
  }
  return "";
}

std::string row(const std::string& part, const std::string& parameter, const char* unit,
                double nominal, double calibrated, const std::string& u95) {
  return fmt::format("{},{},{},{:.12g},{:.12g},{:.6g},{}\n", csv_field(part), parameter, unit,
                     nominal, calibrated, calibrated - nominal, u95);
}

/// The name, with a number behind it if another tool has it.
std::string unused(const std::string& name, std::set<std::string>& used) {
  std::string one = name;
  for (int n = 2; !used.insert(one).second; ++n) one = fmt::format("{}_{}", name, n);
  return one;
}

std::string pose_rows(const std::string& part, const Pose& nominal, const Pose& calibrated) {
  std::string text;
  const Vector3 a = nominal.translation() * to_mm(1), b = calibrated.translation() * to_mm(1);
  const Vector3 ra = zyx_angles(nominal.linear()) * to_deg(1),
                rb = zyx_angles(calibrated.linear()) * to_deg(1);
  for (int k = 0; k < 3; ++k) text += row(part, std::string(1, "xyz"[k]), "mm", a(k), b(k), "");
  for (int k = 0; k < 3; ++k)
    text += row(part, std::array{"roll", "pitch", "yaw"}[static_cast<std::size_t>(k)], "deg",
                ra(2 - k), rb(2 - k), "");
  return text;
}

}  // namespace

std::string left_out_text(const RigidRobot& robot) {
  if (robot.left_out.empty())
    return "nothing is left out: rigid links are all that the model has\n";
  std::string text =
      fmt::format("left out, at {} poses of the model's domain:\n  {:<34}{:>10}{:>10}\n",
                  robot.poses, "what", "rms mm", "max mm");
  for (const LeftOut& one : robot.left_out)
    text += fmt::format("  {:<34}{:>10.4f}{:>10.4f}\n", one.plain, to_mm(one.rms), to_mm(one.most));
  return text + fmt::format("  {:<34}{:>10.4f}{:>10.4f}\n", "all together", to_mm(robot.rms),
                            to_mm(robot.most));
}

std::string urdf_text(const CompensatedModel& model, const RigidRobot& robot) {
  const Chain& chain = model.cell().robot;
  std::string text =
      fmt::format("<?xml version=\"1.0\"?>\n<robot name=\"{}\">\n", xml(model.cell().name));
  text += "  <!-- " +
          xml_comment(
              fmt::format("{}, calibrated: model {} of batch {}. Lengths in m, angles in rad.\n{}",
                          shown(chain.name()), model.provenance().id,
                          shown(model.provenance().figures_batch_id()), left_out_text(robot))) +
          "  effort and velocity 0: not known -->\n";
  text += "  <link name=\"world\"/>\n";
  text += joint("controller_base", "fixed", "world", "controller_base", robot.X_WB_nominal);
  text += joint("base", "fixed", "world", "base_link", robot.X_WB);
  Pose behind = Pose::Identity();
  std::string parent = "base_link";
  for (int j = 0; j < chain.size(); ++j) {
    const LinkGeometry& link = robot.links[static_cast<std::size_t>(j)];
    const std::string child = fmt::format("link_{}", j + 1);
    text += axis_joints(chain, j, parent, behind * before_axis(link), child);
    behind = behind_axis(link);
    parent = child;
  }
  text += joint("flange", "fixed", parent, "flange", behind);
  std::set<std::string> used;
  for (const auto& [name, X_FT] : robot.tools) {
    const std::string link = unused("tool_" + link_name(name), used);
    text += joint(link, "fixed", "flange", link, X_FT);
  }
  return text + "</robot>\n";
}

std::string robot_yaml_text(const CompensatedModel& model, const RigidRobot& robot) {
  const Chain& chain = model.cell().robot;
  std::string text = fmt::format("# Calibrated: model {} of cell {}.\n", model.provenance().id,
                                 shown(model.cell().name));
  std::string left = left_out_text(robot);
  for (auto at = left.find('\n'); at + 1 < left.size(); at = left.find('\n', at + 1))
    left.insert(at + 1, "# ");
  text += "# " + left + "# For the cell file:\n";
  text += fmt::format("#   base: {}\n", pose_yaml(robot.X_WB));
  for (const auto& [name, X_FT] : robot.tools)
    text += fmt::format("#   tools: {{{}: {}}}\n", shown(name), pose_yaml(X_FT));
  text +=
      fmt::format("version: 1\nname: {}\n", nlohmann::json(chain.name() + ", calibrated").dump());
  return text + joints_yaml(chain, robot.links);
}

std::string robot_table(const CompensatedModel& model, const RigidRobot& robot) {
  std::string text = "part,parameter,unit,nominal,calibrated,correction,u95\n";
  text += pose_rows("base", robot.X_WB_nominal, robot.X_WB);
  for (std::size_t j = 0; j < robot.links.size(); ++j) {
    const LinkGeometry &was = robot.nominal[j], &is = robot.links[j];
    const std::string part = fmt::format("joint {}", j + 1), number = std::to_string(j + 1);
    const bool hayati = model.cell().robot.joint(static_cast<int>(j)).hayati;
    text +=
        row(part, "theta", "deg", to_deg(was.theta), to_deg(is.theta), u95_of(model, "q" + number));
    if (!hayati)
      text += row(part, "d", "mm", to_mm(was.d), to_mm(is.d), u95_of(model, "d" + number));
    text += row(part, "a", "mm", to_mm(was.a), to_mm(is.a), u95_of(model, "a" + number));
    text += row(part, "alpha", "deg", to_deg(was.alpha), to_deg(is.alpha),
                u95_of(model, "alpha" + number));
    if (hayati)
      text += row(part, "beta", "deg", to_deg(was.beta), to_deg(is.beta),
                  u95_of(model, "beta" + number));
  }
  for (const auto& [name, X_FT] : robot.tools) {
    const auto told = model.cell().tools.find(name);
    const bool known = told != model.cell().tools.end() && told->second.has_value();
    text += pose_rows("tool " + name, known ? *told->second : Pose::Identity(), X_FT);
  }
  return text;
}

nlohmann::ordered_json robot_json(const CompensatedModel& model, const RigidRobot& robot) {
  nlohmann::ordered_json left = nlohmann::ordered_json::array();
  for (const LeftOut& one : robot.left_out) {
    left.push_back({{"source", one.source},
                    {"what", one.plain},
                    {"rms_mm", to_mm(one.rms)},
                    {"max_mm", to_mm(one.most)}});
  }
  return {{"cell", model.cell().name},
          {"model", model.provenance().id},
          {"poses", robot.poses},
          {"left_out", std::move(left)},
          {"left_out_rms_mm", to_mm(robot.rms)},
          {"left_out_max_mm", to_mm(robot.most)},
          {"notes", notes_json(notes_of(model))}};
}

}  // namespace trammel::cli
