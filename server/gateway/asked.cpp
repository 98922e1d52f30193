#include "server/gateway/asked.h"

#include <fmt/format.h>

#include <limits>
#include <utility>

#include "server/base/units.h"

namespace trammel {
namespace {

constexpr double kMissing =
    std::numeric_limits<double>::quiet_NaN();  // is refused before the service is asked

std::vector<double> joints_in(JsonReader& item, const exchange::Rails& rails) {
  std::vector<double> joints = item.numbers("joints_deg");
  for (std::size_t j = 0; j < joints.size(); ++j) {
    if (!exchange::is_rail(rails, j)) joints[j] = from_deg(joints[j]);
  }
  return joints;
}

exchange::Approach approach_in(JsonReader& item) {
  return {item.integers("directions"), item.number("temperature_c"), item.number("time_s")};
}

exchange::Pose pose_in(JsonReader& item) {
  const auto read = [&](const char* name) {
    if (!item.has(name)) item.refuse(name, "a number");
    return item.number(name).value_or(kMissing);
  };
  return {{read("x_mm"), read("y_mm"), read("z_mm")},
          {read("qw"), read("qx"), read("qy"), read("qz")}};
}

exchange::AskedTarget target_in(JsonReader& item, const exchange::Rails& rails) {
  item.only({"name", "x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz", "conf", "joints_deg",
             "directions", "temperature_c", "time_s"});
  exchange::AskedTarget target;
  target.seed_rad = joints_in(item, rails);
  target.conf = item.integer("conf");
  target.joint_target = !item.has("x_mm") && !target.seed_rad.empty();
  if (!target.joint_target) target.pose = pose_in(item);
  target.approach = approach_in(item);
  if (target.conf && !target.seed_rad.empty()) item.refuse("conf", "either a branch or joints");
  if (!target.conf && target.seed_rad.empty())
    item.refuse("conf", "a branch, or `joints_deg` near the target");
  return target;
}

}  // namespace

CallAbout about_in(JsonReader& body, const std::string& cell) {
  return {cell, body.text("tool"), body.text("payload"), body.flag("controller_compensates"),
          body.text("model")};
}

Result<std::vector<exchange::AskedJoints>> poses_in(JsonReader& body,
                                                    const exchange::Rails& rails) {
  std::vector<exchange::AskedJoints> poses;
  for (const nlohmann::json& one : body.list("poses")) {
    JsonReader item(one, fmt::format("joint vector {}", poses.size() + 1));
    item.only({"pose_id", "joints_deg", "directions", "temperature_c", "time_s"});
    std::vector<double> joints = joints_in(item, rails);
    poses.push_back({std::move(joints), approach_in(item)});
    TRY(item.status());
  }
  TRY(body.status());
  return poses;
}

Result<std::vector<exchange::AskedTarget>> targets_in(JsonReader& body,
                                                      const exchange::Rails& rails) {
  std::vector<exchange::AskedTarget> targets;
  for (const nlohmann::json& one : body.list("targets")) {
    JsonReader item(one, fmt::format("target {}", targets.size() + 1));
    targets.push_back(target_in(item, rails));
    TRY(item.status());
  }
  TRY(body.status());
  return targets;
}

}  // namespace trammel
