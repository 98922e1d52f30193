#include "server/report/model_scene.h"

#include <algorithm>
#include <cmath>

#include "server/base/units.h"
#include "server/compensate/accuracy.h"
#include "server/robot/arm_shape.h"

namespace trammel {

namespace {

using nlohmann::ordered_json;

constexpr int kRings = 10;
constexpr int kSectors = 36;
constexpr int kShellPoses = 4000;        // poses in range from which the shell is drawn
constexpr std::size_t kMostPoses = 300;  // with their arms
constexpr int kUnmeasured = 120;         // poses of the domain, where none is known

ordered_json point(const Vector3& p_B) {
  const auto tenth = [](double m) { return std::round(to_mm(m) * 10) / 10; };
  return {tenth(p_B.x()), tenth(p_B.y()), tenth(p_B.z())};
}

ordered_json error(const Vector3& e_B) {
  const auto fine = [](double m) { return std::round(to_mm(m) * 1e5) / 1e5; };
  return {fine(e_B.x()), fine(e_B.y()), fine(e_B.z())};
}

/// The corners of the nominal arm, from the base to the tool.
ordered_json arm(const CompensatedModel& model, const PoseContext& context) {
  const auto tool = model.parts().physics.tools.find(context.tool);
  const bool known = tool != model.parts().physics.tools.end();
  ordered_json corners = {point(Vector3::Zero())};
  for (const ArmPart& part :
       arm_parts(model.cell().robot, context.q,
                 known ? std::optional<Vector3>(tool->second.translation()) : std::nullopt))
    corners.push_back(point(part.to_B));
  return corners;
}

/// The farthest tool places from the first axis, by height and by direction; m.
struct Shell {
  double low = 0, high = 0;
  std::vector<std::vector<double>> radius = std::vector(kRings, std::vector<double>(kSectors, 0));
};

Shell shell_of(const std::vector<Vector3>& places) {
  Shell shell{places.front().z(), places.front().z()};
  for (const Vector3& p : places) {
    shell.low = std::min(shell.low, p.z());
    shell.high = std::max(shell.high, p.z());
  }
  const double height = std::max(1e-6, shell.high - shell.low);
  for (const Vector3& p : places) {
    const auto ring = std::min(kRings - 1, static_cast<int>(kRings * (p.z() - shell.low) / height));
    const double turn = (std::atan2(p.y(), p.x()) + kPi) / (2 * kPi);
    const auto sector = std::min(kSectors - 1, static_cast<int>(kSectors * turn));
    double& radius = shell.radius[static_cast<std::size_t>(ring)][static_cast<std::size_t>(sector)];
    radius = std::max(radius, p.head<2>().norm());
  }
  return shell;
}

/// Nominal places of the tool, in B.
std::vector<Vector3> tool_places(const std::vector<PoseContext>& range,
                                 const CompensatedModel& model) {
  const PhysicalModel& physics = model.parts().physics;
  const Pose X_BW = physics.X_WB.inverse();
  std::vector<Vector3> places;
  for (const PoseContext& context : range)
    places.push_back(X_BW * physics.nominal_pose_W(context).translation());
  return places;
}

/// The region of the domain in numbers.
ordered_json promised_json(const std::vector<Vector3>& places, const Shell& shell) {
  Vector3 lower = places.front(), upper = places.front();
  for (const Vector3& p : places) {
    lower = lower.cwiseMin(p);
    upper = upper.cwiseMax(p);
  }
  double radius = 0, squares = 0;
  for (const std::vector<double>& ring : shell.radius) {
    for (const double r : ring) {
      radius = std::max(radius, r);
      squares += r * r;
    }
  }
  const double sector = kPi / kSectors * (shell.high - shell.low) / kRings;
  return {{"lower", point(lower)},
          {"upper", point(upper)},
          {"radius_mm", std::round(to_mm(radius))},
          {"volume_m3", squares * sector}};
}

ordered_json shell_json(const Shell& shell) {
  ordered_json rings = ordered_json::array();
  for (int r = 0; r < kRings; ++r) {
    ordered_json ring = ordered_json::array();
    const double z = shell.low + (r + 0.5) / kRings * (shell.high - shell.low);
    for (int s = 0; s < kSectors; ++s) {
      const double angle = 2 * kPi * (s + 0.5) / kSectors - kPi;
      const double radius = shell.radius[static_cast<std::size_t>(r)][static_cast<std::size_t>(s)];
      ring.push_back(radius > 0 ? point({radius * std::cos(angle), radius * std::sin(angle), z})
                                : ordered_json());
    }
    rings.push_back(ring);
  }
  return rings;
}

ordered_json measured(const CompensatedModel& model, const ShownPoses& shown) {
  ordered_json poses = ordered_json::array();
  const std::size_t step = shown.poses.size() / kMostPoses + 1;
  for (std::size_t i = 0; i < shown.poses.size(); i += step) {
    const ShownPose& pose = shown.poses[i];
    if (!pose.context) continue;
    poses.push_back({{"id", pose.id},
                     {"arm", arm(model, *pose.context)},
                     {"before", error(pose.nominal.value_or(pose.calibrated))},
                     {"after", error(pose.compensated)},
                     {"in_domain", pose.in_domain}});
  }
  return poses;
}

ordered_json expected(const CompensatedModel& model, const std::vector<PoseContext>& domain) {
  const std::vector<ErrorPrediction> predictions = model.predict_all(domain);
  ordered_json poses = ordered_json::array();
  for (std::size_t i = 0; i < domain.size(); ++i)
    poses.push_back({{"id", fmt::format("pose {} of the domain", i + 1)},
                     {"arm", arm(model, domain[i])},
                     {"before", error(predictions[i].error_B)},
                     {"after", error(Vector3::Zero())},
                     {"in_domain", true}});
  return poses;
}

}  // namespace

ordered_json scene_json(const CompensatedModel& model, const ShownPoses& shown) {
  const std::vector<PoseContext> range = poses_in_range(model, kShellPoses);
  if (range.empty()) return nullptr;
  ordered_json poses = measured(model, shown);
  const bool known = !poses.empty();
  if (!known) poses = expected(model, poses_of_domain(model, kUnmeasured));
  const std::vector<Vector3> places = tool_places(range, model);
  const Shell shell = shell_of(places);
  ordered_json scene = {{"poses", poses},
                        {"shell", shell_json(shell)},
                        {"promised", promised_json(places, shell)},
                        {"measured", known}};
  if (const auto& box = model.parts().measured)
    scene["box"] = {point(box->lower), point(box->upper)};
  return scene;
}

}  // namespace trammel
