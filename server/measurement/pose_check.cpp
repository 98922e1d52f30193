#include "server/measurement/pose_check.h"

#include "server/measurement/pose_columns.h"

namespace trammel {

namespace {

constexpr double kLimitTolerance = 1e-6;  // rad, m: what a file rounds away

}  // namespace

Status check_joint_columns(const std::vector<JointType>& columns, const Chain& robot, const std::string& where) {
  if (static_cast<int>(columns.size()) != robot.size()) {
    return refused("{}: {} joint columns, robot {} has {}", where, columns.size(), robot.name(), robot.size());
  }
  for (int j = 0; j < robot.size(); ++j) {
    const JointType type = columns[static_cast<std::size_t>(j)];
    if (type == robot.joint(j).type) continue;
    return refused("{}: column {}, but joint {} of robot {} is {}: expected {}", where, joint_column(j, type), j + 1,
                   robot.name(), robot.joint(j).type == JointType::kPrismatic ? "prismatic" : "revolute",
                   joint_column(j, robot.joint(j).type));
  }
  return {};
}

Status check_pose(PoseContext& context, const Cell& cell, const std::string& where) {
  if (const auto outside = cell.robot.joint_outside_limits(context.q, kLimitTolerance)) {
    const Joint& joint = cell.robot.joint(*outside);
    const double value = context.q(*outside);
    return refused("{}: joint {} is {}, limit {}", where, *outside + 1, joint_text(value, joint.type),
                   joint_text(value < joint.lower ? joint.lower : joint.upper, joint.type));
  }
  Result<std::string> tool = resolve_tool(cell, context.tool);
  if (!tool) return refused("{}: {}", where, sentence(tool.error()));
  Result<std::string> payload = resolve_payload(cell, context.payload);
  if (!payload) return refused("{}: {}", where, sentence(payload.error()));
  context.tool = std::move(*tool);
  context.payload = std::move(*payload);
  return {};
}

}  // namespace trammel
