#include "server/report/work_json.h"

#include "server/base/units.h"

namespace trammel {
namespace {

using nlohmann::ordered_json;

ordered_json joints_json(const JointVector& q, const Chain& robot) {
  ordered_json joints = ordered_json::array();
  for (int j = 0; j < robot.size(); ++j)
    joints.push_back(robot.joint(j).type == JointType::kRevolute ? to_deg(q(j)) : to_mm(q(j)));
  return joints;
}

/// `q1_deg`, or `q7_mm` of a rail.
ordered_json columns_json(const Chain& robot) {
  ordered_json columns = ordered_json::array();
  for (int j = 0; j < robot.size(); ++j)
    columns.push_back(
        fmt::format("q{}_{}", j + 1, robot.joint(j).type == JointType::kRevolute ? "deg" : "mm"));
  return columns;
}

ordered_json promised_json(int version, const PromisedAtWork& promised) {
  return {{"version", version},
          {"out_of_domain", promised.out_of_domain},
          {"expected_rms_mm", to_mm(promised.rms)}};
}

std::string promised_text(const std::string& who, const ordered_json& promised, int poses) {
  return fmt::format(
      "{} version {}: true error expected {:.4f} mm rms, {} of {} poses out of its domain\n", who,
      promised.at("version").get<int>(), promised.at("expected_rms_mm").get<double>(),
      promised.at("out_of_domain").get<int>(), poses);
}

}  // namespace

ordered_json work_json(const WorkAsked& work, const WorkVersions& versions, const Chain& robot) {
  ordered_json json = {{"cell", versions.cell},
                       {"poses", work.poses},
                       {"in_force", promised_json(versions.in_force, work.in_force)},
                       {"other", nullptr},
                       {"difference", nullptr},
                       {"next_poses_for", {{"columns", columns_json(robot)}}},
                       {"next_poses", ordered_json::array()}};
  for (const PoseContext& pose : work.measure_next)
    json["next_poses"].push_back(joints_json(pose.q, robot));
  if (!work.other) return json;
  json["other"] = promised_json(versions.other, *work.other);
  ordered_json farthest = ordered_json::array();
  for (const WorkAsked::Step& step : work.farthest)
    farthest.push_back(
        {{"joints", joints_json(step.pose.q, robot)}, {"difference_mm", to_mm(step.difference)}});
  json["difference"] = {{"rms_mm", to_mm(work.difference_rms)},
                        {"max_mm", to_mm(work.difference_max)},
                        {"farthest", std::move(farthest)}};
  return json;
}

std::string work_text(const ordered_json& work) {
  const std::string cell = work.at("cell");
  const int poses = work.at("poses");
  if (poses == 0)
    return fmt::format("cell {}: nobody has asked for a pose since the service was started\n",
                       cell);
  std::string text = fmt::format("cell {}: the last {} poses that were asked for\n", cell, poses);
  text += promised_text("in force, ", work.at("in_force"), poses);
  if (!work.at("other").is_null()) {
    const ordered_json& difference = work.at("difference");
    text += promised_text("beside it, ", work.at("other"), poses);
    text +=
        fmt::format("their corrections differ by {:.4f} mm rms, at most {:.4f} mm\n",
                    difference.at("rms_mm").get<double>(), difference.at("max_mm").get<double>());
  }
  text +=
      fmt::format("{} poses would tell most if they were measured\n", work.at("next_poses").size());
  return text;
}

}  // namespace trammel
