#include "server/tasks/accept/fits_cell.h"

#include <fmt/ranges.h>

#include <array>
#include <string>
#include <vector>

namespace trammel {

namespace {

/// True if a model of one serves the other: the kinematics count, names and priors do not.
bool same_robot(const Chain& a, const Chain& b) {
  if (a.size() != b.size() || a.transmission() != b.transmission() || a.drive() != b.drive())
    return false;
  for (int i = 0; i < a.size(); ++i) {
    const Joint& one = a.joint(i);
    const Joint& other = b.joint(i);
    const auto numbers = [](const LinkGeometry& l) {
      return std::array{l.theta, l.d, l.a, l.alpha, l.beta};
    };
    if (one.type != other.type || numbers(one.link) != numbers(other.link)) return false;
  }
  return true;
}

enum class Payloads { kTheSame, kAny };

/// The tools and payloads of the model's training that the cell now describes differently.
std::vector<std::string> other_tools(const CompensatedModel& model, const Cell& cell,
                                     Payloads payloads) {
  const auto same_pose = [](const std::optional<Pose>& a, const std::optional<Pose>& b) {
    return a.has_value() == b.has_value() && (!a || a->matrix() == b->matrix());
  };
  const auto same_payload = [](const auto& known, const auto& present, const std::string& name) {
    if (name.empty()) return true;
    const auto now = present.find(name);
    return now != present.end() && now->second.mass == known.at(name).mass &&
           now->second.p_FoCog_F == known.at(name).p_FoCog_F;
  };
  std::vector<std::string> others;
  for (const auto& [tool, payload] : model.parts().trained_with) {
    const auto now = cell.tools.find(tool);
    if (now == cell.tools.end() || !same_pose(now->second, model.cell().tools.at(tool)))
      others.push_back(fmt::format("tool {}", tool));
    if (payloads == Payloads::kTheSame &&
        !same_payload(model.cell().payloads, cell.payloads, payload))
      others.push_back(fmt::format("payload {}", payload));
  }
  return others;
}

Status check(const CompensatedModel& model, const Cell& cell, const std::string& which,
             Payloads payloads) {
  if (!same_robot(model.cell().robot, cell.robot)) {
    return refused("{} was trained for another robot than cell {} has", which, cell.name)
        .of("robot");
  }
  if (const std::vector<std::string> others = other_tools(model, cell, payloads); !others.empty()) {
    return refused(
               "{} was trained with other tools or payloads than cell {} has under these names: {}",
               which, cell.name, fmt::join(others, ", "))
        .of("tools")
        .with_text(others.front());
  }
  return {};
}

}  // namespace

Status check_fits_cell(const CompensatedModel& model, const Cell& cell, const std::string& which) {
  return check(model, cell, which, Payloads::kTheSame);
}

Status check_comparable(const CompensatedModel& before, const CompensatedModel& now) {
  return check(before, now.cell(), "model " + before.provenance().id, Payloads::kAny);
}

}  // namespace trammel
