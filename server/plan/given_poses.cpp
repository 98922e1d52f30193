#include <algorithm>

#include "server/plan/approach.h"
#include "server/plan/plan.h"

namespace trammel {

namespace {

/// The sides to try: the recorded one where it is the same for all joints, else both.
std::vector<int> sides_of(const PoseContext& context) {
  const std::vector<int>& recorded = context.direction;
  const bool one_side = !recorded.empty() && recorded.front() != 0 &&
                        std::all_of(recorded.begin(), recorded.end(), [&](int d) { return d == recorded.front(); });
  return one_side ? std::vector<int>{recorded.front()} : std::vector<int>{1, -1};
}

Result<PlannedPose> planned_pose(const Chain& robot, const CommandedPose& given, const std::string& where) {
  PlannedPose pose{given.pose_id, given.context, {}};
  pose.context.q = on_program_grid(robot, given.context.q);
  for (const int side : sides_of(given.context)) {
    const auto bump = bump_pose(robot, pose.context.q, side);
    if (!bump) continue;
    pose.bump = on_program_grid(robot, *bump);
    pose.context.direction.assign(static_cast<std::size_t>(robot.size()), side);
    return pose;
  }
  return refused("pose {} is too near to a joint limit to be approached", given.pose_id)
      .in(where)
      .at_row(given.row)
      .of("pose_id")
      .with_text(given.pose_id);
}

}  // namespace

Result<Plan> plan_of(const Cell& cell, const JointList& list) {
  Plan plan;
  for (const CommandedPose& given : list.poses) {
    Result<PlannedPose> pose = planned_pose(cell.robot, given, list.where);
    if (!pose) return tl::make_unexpected(pose.error());
    pose->context.index = static_cast<int>(plan.poses.size());
    plan.poses.push_back(std::move(*pose));
  }
  plan.draw.drawn = plan.draw.kept = static_cast<int>(plan.poses.size());
  return plan;
}

}  // namespace trammel
