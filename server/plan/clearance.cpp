#include "server/plan/clearance.h"

#include <fmt/format.h>

#include <algorithm>

#include "server/base/units.h"

namespace trammel {

namespace {

constexpr int kHalvings = 60;  // of the line, to the place that is nearest to a box

void take_deeper(std::optional<Touch>& deepest, const Touch& one) {
  if (one.by > 0 && (!deepest || one.by > deepest->by)) deepest = one;
}

}  // namespace

double distance_to_box(const Vector3& from, const Vector3& to, const Workspace& box) {
  const auto distance = [&](double share) {
    const Vector3 p = from + share * (to - from);
    return (p - p.cwiseMax(box.lower).cwiseMin(box.upper)).norm();
  };
  // The distance from a convex body is convex along a line.
  double low = 0, high = 1;
  for (int i = 0; i < kHalvings; ++i) {
    const double a = low + (high - low) / 3, b = high - (high - low) / 3;
    (distance(a) <= distance(b) ? high : low) = distance(a) <= distance(b) ? b : a;
  }
  return distance((low + high) / 2);
}

Clearance::Clearance(const Cell& cell, const std::string& tool)
    : cell_(cell), around_(obstacles_of(cell).value_or(std::nullopt)) {
  const auto known = cell.tools.find(tool);
  if (known != cell.tools.end() && known->second) tool_F_ = known->second->translation();
  while (standing_ + 1 < cell.robot.size() &&
         cell.robot.joint(standing_).type != JointType::kRevolute)
    ++standing_;
}

double Clearance::radius_of(const ArmPart& part) const {
  if (!around_ || around_->link_radius.empty()) return Obstacles::kUsualRadius;
  const std::vector<double>& stated = around_->link_radius;
  return stated[std::min(static_cast<std::size_t>(part.link), stated.size() - 1)];
}

std::optional<Touch> Clearance::touch_at(const JointVector& q) const {
  if (!around_) return std::nullopt;
  const Obstacles& around = *around_;
  std::optional<Touch> deepest;
  for (const ArmPart& part : arm_parts(cell_.robot, q, tool_F_)) {
    const double radius = radius_of(part);
    const bool stands = part.link <= standing_;
    if (around.floor && !stands) {
      const double lowest = std::min(part.from_B.z(), part.to_B.z()) - *around.floor;
      take_deeper(deepest, {part.link, "the floor", radius - lowest});
    }
    for (const Obstacles::Box& box : around.boxes) {
      if (box.carries && stands) continue;
      take_deeper(deepest, {part.link, box.carries ? box.name : "box " + box.name,
                            radius - distance_to_box(part.from_B, part.to_B, box.box)});
    }
  }
  return deepest;
}

std::string in_words(const Touch& touch, const Chain& robot) {
  const std::string part =
      touch.link >= robot.size() ? std::string("the tool") : fmt::format("link {}", touch.link + 1);
  return fmt::format("{} touches {} by {:.0f} mm", part, touch.what,
                     std::max(1.0, to_mm(touch.by)));
}

std::string obstacles_in_words(const Cell& cell) {
  const std::optional<Obstacles> stated = obstacles_of(cell).value_or(std::nullopt);
  if (!stated) return "";
  const Obstacles& around = *stated;
  std::vector<std::string> names;
  if (around.floor) names.emplace_back("the floor");
  for (const Obstacles::Box& box : around.boxes)
    names.push_back(box.carries ? box.name : "box " + box.name);
  std::vector<double> radii = around.link_radius;
  if (radii.empty()) radii.push_back(Obstacles::kUsualRadius);
  const auto [least, most] = std::minmax_element(radii.begin(), radii.end());
  const std::string thick = *least == *most
                                ? fmt::format("{:.0f} mm", to_mm(*least))
                                : fmt::format("{:.0f} to {:.0f} mm", to_mm(*least), to_mm(*most));
  return fmt::format("{}; links are taken as {} in radius{}", fmt::join(names, ", "), thick,
                     around.link_radius.empty() ? " (link_radii_mm is not stated)" : "");
}

}  // namespace trammel
