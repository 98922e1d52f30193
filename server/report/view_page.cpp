#include "server/report/view_page.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>

#include "server/base/units.h"
#include "server/base/unix_time.h"
#include "server/plan/clearance.h"
#include "server/plan/visibility.h"
#include "server/report/embedded.h"
#include "server/report/html.h"
#include "server/report/page_parts.h"
#include "server/report/pages_beside.h"
#include "server/report/plain_page.h"
#include "server/robot/cell_papers.h"

namespace trammel {

namespace {

using nlohmann::ordered_json;

constexpr std::size_t kMostViewed = 2000;  // poses on the page

ordered_json millimetres_of(const Vector3& p_B) {
  const auto tenth = [](double m) { return std::round(to_mm(m) * 10) / 10; };
  return {tenth(p_B.x()), tenth(p_B.y()), tenth(p_B.z())};
}

/// What is to be said of a pose.
struct PoseSeen {
  Vector3 tool_B = Vector3::Zero();
  std::optional<Touch> touch;
  bool sees = true, inside = true;
};

/// What is needed of the cell for each of its tools, read once.
class Onlooker {
 public:
  explicit Onlooker(const Cell& cell) : cell_(cell) {}
  [[nodiscard]] PoseSeen look_at(const ViewedPose& pose);
  [[nodiscard]] ordered_json arm_json(const ViewedPose& pose);

 private:
  const Clearance& clearance(const std::string& tool) {
    return clearances_.try_emplace(tool, cell_, tool).first->second;
  }
  const Cell& cell_;
  std::map<std::string, Clearance> clearances_;
};

PoseSeen Onlooker::look_at(const ViewedPose& pose) {
  const Cell& cell = cell_;
  PoseSeen seen;
  const auto tool = cell.tools.find(pose.context.tool);
  const Pose X_FT =
      tool == cell.tools.end() ? Pose::Identity() : tool->second.value_or(Pose::Identity());
  seen.tool_B = (cell.robot.flange_pose(pose.context.q) * X_FT).translation();
  seen.touch = clearance(pose.context.tool).touch_at(pose.context.q);
  if (tool != cell.tools.end() && pose.measured) {
    // Where base or tool are not known yet, nobody can say what the tracker sees.
    const auto visibility = Visibility::of(cell, pose.context.tool);
    seen.sees = !visibility || visibility->sees(pose.context.q);
  }
  if (cell.workspace)
    seen.inside = (seen.tool_B.array() >= cell.workspace->lower.array()).all() &&
                  (seen.tool_B.array() <= cell.workspace->upper.array()).all();
  return seen;
}

std::string doubts_of(const Cell& cell, const PoseSeen& seen) {
  std::vector<std::string> doubts;
  if (seen.touch) doubts.push_back(in_words(*seen.touch, cell.robot));
  if (!seen.sees) doubts.emplace_back("the tracker does not see the target");
  if (!seen.inside) doubts.emplace_back("outside the workspace");
  return fmt::format("{}", fmt::join(doubts, "; "));
}

ordered_json Onlooker::arm_json(const ViewedPose& pose) {
  const Cell& cell = cell_;
  const auto tool = cell.tools.find(pose.context.tool);
  const bool known = tool != cell.tools.end() && tool->second.has_value();
  const Clearance& links = clearance(pose.context.tool);
  ordered_json parts = ordered_json::array();
  for (const ArmPart& part :
       arm_parts(cell.robot, pose.context.q,
                 known ? std::optional<Vector3>(tool->second->translation()) : std::nullopt))
    parts.push_back({millimetres_of(part.from_B), millimetres_of(part.to_B),
                     std::round(to_mm(links.radius_of(part)))});
  return parts;
}

ordered_json box_json(const Workspace& box) {
  return {millimetres_of(box.lower), millimetres_of(box.upper)};
}

ordered_json scene_of(const Cell& cell, const std::vector<ViewedPose>& poses,
                      const std::vector<PoseSeen>& seen, Onlooker& onlooker) {
  ordered_json scene = {{"poses", ordered_json::array()}, {"boxes", ordered_json::array()}};
  for (std::size_t i = 0; i < poses.size(); ++i)
    scene["poses"].push_back({{"name", poses[i].name},
                              {"arm", onlooker.arm_json(poses[i])},
                              {"tool", millimetres_of(seen[i].tool_B)},
                              {"sees", seen[i].sees && poses[i].measured},
                              {"measured", poses[i].measured},
                              {"doubt", doubts_of(cell, seen[i])}});
  if (cell.workspace) scene["workspace"] = box_json(*cell.workspace);
  if (const auto around = obstacles_of(cell).value_or(std::nullopt)) {
    if (around->floor) scene["floor"] = to_mm(*around->floor);
    for (const Obstacles::Box& box : around->boxes)
      scene["boxes"].push_back(
          {{"name", box.name}, {"corners", box_json(box.box)}, {"carries", box.carries}});
  }
  if (cell.tracker.p_W && cell.X_WB)
    scene["tracker"] = millimetres_of(cell.X_WB->inverse() * *cell.tracker.p_W);
  return scene;
}

/// `-0.0` reads like a number that is something.
std::string without_minus_zero(double value, int decimals) {
  const double step = std::pow(10, -decimals);
  return fmt::format("{:.{}f}", std::abs(value) < step / 2 ? 0.0 : value, decimals);
}

std::string shown_joints(const Cell& cell, const JointVector& q) {
  std::string text;
  for (int j = 0; j < q.size(); ++j) {
    const bool turns = cell.robot.joint(j).type == JointType::kRevolute;
    text += (j == 0 ? "" : ", ") + without_minus_zero(turns ? to_deg(q(j)) : to_mm(q(j)), 1);
  }
  return text;
}

std::string viewed_table(const Cell& cell, const std::vector<ViewedPose>& poses,
                         const std::vector<PoseSeen>& seen) {
  std::vector<HtmlRow> rows;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const std::string doubt = doubts_of(cell, seen[i]);
    const Vector3 p = to_mm(1) * seen[i].tool_B;
    rows.push_back({{fmt::format("{}", i + 1), html_text(poses[i].name),
                     without_minus_zero(p.x(), 0), without_minus_zero(p.y(), 0),
                     without_minus_zero(p.z(), 0), html_text(poses[i].context.tool),
                     shown_joints(cell, poses[i].context.q), html_text(doubt)},
                    doubt.empty() ? "" : "changed"});
  }
  return html_table({"viewed flows sorts",
                     {"order", "pose", "x, mm", "y, mm", "z, mm", "tool", "joints, deg", ""},
                     rows});
}

/// The joints at zero, or at the end of their range that is nearest.
JointVector rest_pose(const Cell& cell) {
  JointVector q = JointVector::Zero(cell.robot.size());
  for (int j = 0; j < cell.robot.size(); ++j)
    q(j) = std::clamp(0.0, cell.robot.joint(j).lower, cell.robot.joint(j).upper);
  return q;
}

std::vector<ViewedPose> poses_viewed(const Cell& cell, const Viewed& viewed) {
  std::vector<ViewedPose> poses = viewed.poses;
  if (poses.size() > kMostViewed) poses.resize(kMostViewed);
  if (poses.empty()) {
    ViewedPose rest{"rest pose", {}, false};
    rest.context.q = rest_pose(cell);
    if (!cell.tools.empty()) rest.context.tool = cell.tools.begin()->first;
    poses.push_back(std::move(rest));
  }
  return poses;
}

std::string view_verdict(const Cell& cell, const Viewed& viewed) {
  if (viewed.poses.empty())
    return "<span class=\"badge\">cell</span>The cell alone, at its rest pose: name a plan or a "
           "program to see its poses.";
  const ViewFindings found = view_findings(cell, viewed);
  const bool stated = !obstacles_in_words(cell).empty();
  std::vector<std::string> doubts;
  if (found.touching > 0) doubts.push_back(fmt::format("{} touch an obstacle", found.touching));
  if (found.unseen > 0)
    doubts.push_back(fmt::format("{} are out of the tracker's sight", found.unseen));
  if (found.outside > 0)
    doubts.push_back(fmt::format("{} are outside the workspace", found.outside));
  if (!viewed.left.empty()) doubts.push_back(fmt::format("{} have no joints", viewed.left.size()));
  if (!doubts.empty())
    return fmt::format("<span class=\"badge bad\">look</span>Of {} poses {}.", found.poses,
                       fmt::join(doubts, ", "));
  const bool measures = std::any_of(viewed.poses.begin(), viewed.poses.end(),
                                    [](const ViewedPose& pose) { return pose.measured; });
  const std::string where = measures ? "in sight and inside the workspace" : "inside the workspace";
  return stated ? fmt::format(
                      "<span class=\"badge good\">clear</span>All {} poses are clear of what "
                      "is stated, and {}.",
                      found.poses, where)
                : fmt::format(
                      "<span class=\"badge soon\">look</span>All {} poses are {}. No obstacle "
                      "is stated, so nothing was held against the arm: look yourself.",
                      found.poses, where);
}

std::string limits_of_view(const Cell& cell, const Viewed& viewed) {
  const std::string around = obstacles_in_words(cell);
  std::string list = fmt::format(
      "<li>{}</li><li>The arm is its nominal one, the lines of the robot file with a radius; "
      "cables "
      "and the ways between poses are not looked at.</li>",
      around.empty() ? "No obstacle is stated: write obstacles into the cell file "
                       "(floor_mm, mounting, boxes, link_radii_mm)."
                     : "Obstacles: " + html_text(around) + ".");
  if (!cell.tracker.p_W || !cell.X_WB)
    list +=
        "<li>Where the tracker stands is not in the cell file (tracker: xyz_mm), or the base is "
        "not known: no line of sight is drawn.</li>";
  else if (!cell.tracker.aperture)
    list +=
        "<li>The cell file gives no aperture (tracker: aperture_deg): every pose counts as "
        "seen.</li>";
  for (const std::string& one : viewed.left) list += "<li>" + html_text(one) + "</li>";
  if (viewed.poses.size() > kMostViewed)
    list += fmt::format("<li>The first {} of {} poses are drawn.</li>", kMostViewed,
                        viewed.poses.size());
  return "<ul>" + list + "</ul>";
}

}  // namespace

ViewFindings view_findings(const Cell& cell, const Viewed& viewed) {
  ViewFindings found;
  Onlooker onlooker(cell);
  for (const ViewedPose& pose : viewed.poses) {
    const PoseSeen seen = onlooker.look_at(pose);
    ++found.poses;
    found.touching += seen.touch ? 1 : 0;
    found.unseen += seen.sees ? 0 : 1;
    found.outside += seen.inside ? 0 : 1;
  }
  return found;
}

std::string view_page(const Cell& cell, const Viewed& viewed) {
  const std::vector<ViewedPose> poses = poses_viewed(cell, viewed);
  std::vector<PoseSeen> seen;
  Onlooker onlooker(cell);
  for (const ViewedPose& pose : poses) seen.push_back(onlooker.look_at(pose));
  return fill_in(
      embedded::view_page_html,
      {{"title", html_text("Cell " + cell.name + " in space")},
       {"mark", page_mark({"view", cell.name})},
       {"subtitle",
        html_text(fmt::format("{}{} · {}{}", cell.robot.name(),
                              viewed.what.empty() ? "" : " · " + viewed.what, shown_day(unix_now()),
                              papers_text(papers_of(cell).value_or(CellPapers{}))))},
       {"verdict", view_verdict(cell, viewed)},
       {"limits", limits_of_view(cell, viewed)},
       {"table", viewed_table(cell, poses, seen)},
       {"data", script_json(scene_of(cell, poses, seen, onlooker))},
       {"page_css", std::string(page_style())},
       {"sort_tables_js", std::string(sort_tables_script())},
       {"view3d_js", std::string(view3d_script())}});
}

}  // namespace trammel
