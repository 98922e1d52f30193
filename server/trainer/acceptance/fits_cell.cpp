#include "server/trainer/acceptance/fits_cell.h"

#include <algorithm>
#include <array>

namespace trammel {

namespace {

/// Whether a model of one serves the other: the kinematics count, names and priors do not.
bool same_robot(const Chain& a, const Chain& b) {
  if (a.size() != b.size() || a.transmission() != b.transmission()) return false;
  for (int i = 0; i < a.size(); ++i) {
    const Joint& one = a.joint(i);
    const Joint& other = b.joint(i);
    const auto numbers = [](const LinkGeometry& l) { return std::array{l.theta, l.d, l.a, l.alpha, l.beta}; };
    if (one.type != other.type || numbers(one.link) != numbers(other.link)) return false;
  }
  return true;
}

/// Whether the tools and payloads that the model was trained with are still what the cell says they are.
bool same_tools(const CompensatedModel& model, const Cell& cell) {
  const auto same_pose = [](const std::optional<Pose>& a, const std::optional<Pose>& b) {
    return a.has_value() == b.has_value() && (!a || a->matrix() == b->matrix());
  };
  const auto same_payload = [](const auto& known, const auto& present, const std::string& name) {
    if (name.empty()) return true;
    const auto now = present.find(name);
    return now != present.end() && now->second.mass == known.at(name).mass &&
           now->second.p_FoCog_F == known.at(name).p_FoCog_F;
  };
  const auto& trained_with = model.parts().trained_with;
  return std::all_of(trained_with.begin(), trained_with.end(), [&](const auto& pair) {
    const auto& [tool, payload] = pair;
    const auto now = cell.tools.find(tool);
    return now != cell.tools.end() && same_pose(now->second, model.cell().tools.at(tool)) &&
           same_payload(model.cell().payloads, cell.payloads, payload);
  });
}

}  // namespace

Status check_fits_cell(const CompensatedModel& model, const Cell& cell, const std::string& which) {
  if (!same_robot(model.cell().robot, cell.robot)) {
    return refused("{} was trained for another robot than cell {} has", which, cell.name).of("robot");
  }
  if (!same_tools(model, cell)) {
    return refused("{} was trained with other tools or payloads than cell {} has under these names", which, cell.name)
        .of("tools");
  }
  return {};
}

}  // namespace trammel
