#include <algorithm>

#include "server/plan/approach.h"
#include "server/plan/clearance.h"
#include "server/plan/plan.h"

namespace trammel {

namespace {

/// The recorded sides if each joint has one; otherwise the planned sides that the limits allow.
Sides sides_of(const Chain& robot, const PoseContext& context, int number) {
  const Sides& recorded = context.direction;
  const bool known = !recorded.empty() && std::count(recorded.begin(), recorded.end(), 0) == 0;
  return known ? recorded : possible_sides(robot, context.q, planned_sides(robot, number));
}

Result<PlannedPose> planned_pose(const Chain& robot, const CommandedPose& given, int number,
                                 const std::string& where) {
  PlannedPose pose{given.pose_id, given.context, {}};
  pose.context.index = number;
  pose.context.q = on_program_grid(robot, given.context.q);
  pose.context.direction = sides_of(robot, pose.context, number);
  const auto bump = bump_pose(robot, pose.context.q, pose.context.direction);
  if (!bump) {
    return refused("pose {} is too near to a joint limit to be approached", given.pose_id)
        .in(where)
        .at_row(given.row)
        .of("pose_id")
        .with_text(given.pose_id);
  }
  pose.bump = on_program_grid(robot, *bump);
  return pose;
}

/// Refuses a pose where the arm touches a stated obstacle, or does before it is approached.
Status require_clear(const Cell& cell, const PlannedPose& pose, const CommandedPose& given,
                     const std::string& where) {
  const Clearance clearance(cell, pose.context.tool);
  for (const JointVector& q : {pose.context.q, pose.bump}) {
    if (const auto touch = clearance.touch_at(q))
      return refused("pose {}: {}", given.pose_id, in_words(*touch, cell.robot))
          .in(where)
          .at_row(given.row)
          .of("pose_id")
          .with_text(given.pose_id)
          .next("leave it out, or state the obstacles of the cell file as they are");
  }
  return {};
}

}  // namespace

Result<Plan> plan_of(const Cell& cell, const JointList& list) {
  Plan plan;
  for (const CommandedPose& given : list.poses) {
    const auto number = static_cast<int>(plan.poses.size());
    PlannedPose pose = TRY(planned_pose(cell.robot, given, number, list.where));
    TRY(require_clear(cell, pose, given, list.where));
    plan.poses.push_back(std::move(pose));
  }
  plan.clear_of = obstacles_in_words(cell);
  plan.draw.drawn = plan.draw.kept = static_cast<int>(plan.poses.size());
  return plan;
}

}  // namespace trammel
