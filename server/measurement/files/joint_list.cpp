#include "server/measurement/files/joint_list.h"

#include <algorithm>
#include <cmath>

#include "server/base/text_file.h"
#include "server/base/units.h"
#include "server/measurement/files/csv_table.h"
#include "server/measurement/pose_check.h"
#include "server/measurement/pose_columns.h"
#include "server/measurement/reading_units.h"

namespace trammel {

Result<JointList> parse_joint_csv(const std::string& text, const std::string& where) {
  const CsvTable table = TRY(CsvTable::parse(text, where));
  const PoseColumns columns = TRY(PoseColumns::find(table));
  TRY(columns.require_joints(table));
  if (table.size() == 0)
    return refused("no poses below the header, at least 1 is needed").in(where).beyond(0, 1);
  JointList list{where, columns.joint_types(), {}};
  for (std::size_t row = 0; row < table.size(); ++row) {
    PoseContext context = TRY(columns.read(table, row));
    std::string pose_id = TRY(columns.pose_id(table, row));
    list.poses.push_back({std::move(pose_id), std::move(context), table.line(row)});
  }
  return list;
}

Result<JointList> read_joint_csv(const std::string& path) {
  return read_text_file(path).and_then(
      [&](const std::string& text) { return parse_joint_csv(text, path); });
}

std::string to_csv(const JointList& list) {
  const auto any = [&](const auto& has) {
    return std::any_of(list.poses.begin(), list.poses.end(), has);
  };
  const bool directions =
      any([](const CommandedPose& pose) { return !pose.context.direction.empty(); });
  const bool tools = any([](const CommandedPose& pose) { return !pose.context.tool.empty(); });
  const bool payloads =
      any([](const CommandedPose& pose) { return !pose.context.payload.empty(); });
  const std::size_t n = list.joint_types.size();
  std::string text = "pose_id";
  for (std::size_t j = 0; j < n; ++j)
    text += ',' + joint_column(static_cast<int>(j), list.joint_types[j]);
  for (std::size_t j = 0; directions && j < n; ++j) text += fmt::format(",dir{}", j + 1);
  if (tools) text += ",tool_id";
  if (payloads) text += ",payload_id";
  text += '\n';
  for (const CommandedPose& pose : list.poses) {
    const PoseContext& context = pose.context;
    text += csv_field(pose.pose_id);
    for (std::size_t j = 0; j < n; ++j) {
      text += ',' + csv_number(joint_to_column(context.q(static_cast<Eigen::Index>(j)),
                                               list.joint_types[j]));
    }
    for (std::size_t j = 0; directions && j < n; ++j) {
      text += context.direction.empty() ? "," : fmt::format(",{}", context.direction[j]);
    }
    if (tools) text += ',' + csv_field(context.tool);
    if (payloads) text += ',' + csv_field(context.payload);
    text += '\n';
  }
  return text;
}

namespace {

/// Refuses a list whose joints look like radians: all values are small, yet many joints should have
/// turned by several degrees.
Status check_degrees(const JointList& list, const Chain& robot) {
  constexpr std::size_t kFewestPoses = 6;
  constexpr int kFewestTurned =
      4;                         // joints: an arm with more has no pose with all of them near zero
  constexpr double kTurned = 1;  // rad, or deg as read
  if (list.poses.size() < kFewestPoses) return {};
  int turned = 0;
  for (int j = 0; j < robot.size(); ++j) {
    if (robot.joint(j).type != JointType::kRevolute) continue;
    double largest = 0;
    for (const CommandedPose& pose : list.poses)
      largest = std::max(largest, std::abs(to_deg(pose.context.q(j))));
    if (largest > kMostRadians) return {};
    turned += largest > kTurned ? 1 : 0;
  }
  if (turned < kFewestTurned) return {};
  return refused("all joints of {} poses are within {:g} deg of zero", list.poses.size(),
                 kMostRadians)
      .in(list.where)
      .of("q1_deg")
      .next("are the joints radians? They must be degrees");
}

}  // namespace

Result<JointList> check_against_cell(JointList list, const Cell& cell) {
  std::vector<PoseContext*> contexts;
  for (CommandedPose& pose : list.poses) contexts.push_back(&pose.context);
  put_in_passive_joints(cell.robot, list.joint_types, contexts);
  TRY(check_joint_columns(list.joint_types, cell.robot, list.where));
  for (CommandedPose& pose : list.poses) {
    const Status checked = check_pose(pose.context, cell);
    if (!checked) return Failure(checked.error()).in(list.where).at_row(pose.row);
  }
  TRY(check_degrees(list, cell.robot));
  return list;
}

}  // namespace trammel
