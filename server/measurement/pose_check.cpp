#include "server/measurement/pose_check.h"

#include <utility>

#include "server/measurement/pose_columns.h"
#include "server/robot/passive_joint.h"

namespace trammel {

namespace {

constexpr double kColdest = -60, kHottest = 150;  // degrees Celsius, for any robot
constexpr double kLimitTolerance = 1e-6;          // rad, m: lost in the rounding of a file

}  // namespace

Status check_joint_columns(const std::vector<JointType>& columns, const Chain& robot,
                           const std::string& where) {
  if (static_cast<int>(columns.size()) != robot.size()) {
    return refused("{} joint columns, robot {} has {}", columns.size(), robot.name(), robot.size())
        .in(where)
        .beyond(columns.size(), robot.size());
  }
  for (int j = 0; j < robot.size(); ++j) {
    const JointType type = columns[static_cast<std::size_t>(j)];
    if (type == robot.joint(j).type) continue;
    return refused("column {}, but joint {} of robot {} is {}: expected {}", joint_column(j, type),
                   j + 1, robot.name(),
                   robot.joint(j).type == JointType::kPrismatic ? "prismatic" : "revolute",
                   joint_column(j, robot.joint(j).type))
        .in(where)
        .of(joint_column(j, type));
  }
  return {};
}

void put_in_passive_joints(const Chain& robot, std::vector<JointType>& columns,
                           const std::vector<PoseContext*>& poses) {
  std::vector<int> passive;
  for (int j = 0; j < robot.size(); ++j)
    if (is_passive(robot.joint(j))) passive.push_back(j);
  if (passive.empty() || std::ssize(columns) + std::ssize(passive) != robot.size()) return;
  for (const int j : passive) {
    columns.insert(columns.begin() + j, robot.joint(j).type);
    for (PoseContext* pose : poses) {
      JointVector q = JointVector::Zero(pose->q.size() + 1);
      q.head(j) = pose->q.head(j);
      q.tail(q.size() - j - 1) = pose->q.tail(q.size() - j - 1);
      pose->q = std::move(q);
      if (!pose->direction.empty()) pose->direction.insert(pose->direction.begin() + j, 0);
    }
  }
}

Status check_pose(PoseContext& context, const Cell& cell) {
  if (const auto outside = cell.robot.joint_outside_limits(context.q, kLimitTolerance)) {
    const Joint& joint = cell.robot.joint(*outside);
    const double value = context.q(*outside);
    const double limit = value < joint.lower ? joint.lower : joint.upper;
    return refused("joint {} is {}, limit {}", *outside + 1, joint_text(value, joint.type),
                   joint_text(limit, joint.type))
        .of(joint_column(*outside, joint.type))
        .beyond(joint_to_column(value, joint.type), joint_to_column(limit, joint.type))
        .next(
            "is the joint told in this unit, and with the sign and the zero of the robot file? "
            "Else "
            "the limit in that file is another one");
  }
  if (context.temperature && (*context.temperature < kColdest || *context.temperature > kHottest))
    return refused("the arm is said to be at {:g} degrees Celsius, limits {:g} and {:g}",
                   *context.temperature, kColdest, kHottest)
        .of("temperature_c")
        .beyond(*context.temperature, *context.temperature < kColdest ? kColdest : kHottest)
        .next("in kelvin? write degrees Celsius");
  Result<std::string> tool = resolve_tool(cell, context.tool);
  if (!tool) return Failure(tool.error()).as(ErrorCode::kRefused);
  Result<std::string> payload = resolve_payload(cell, context.payload);
  if (!payload) return Failure(payload.error()).as(ErrorCode::kRefused);
  context.tool = std::move(*tool);
  context.payload = std::move(*payload);
  return {};
}

}  // namespace trammel
