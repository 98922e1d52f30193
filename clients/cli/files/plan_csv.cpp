#include "clients/cli/files/plan_csv.h"

#include <utility>

#include "server/measurement/files/joint_list.h"
#include "server/measurement/pose_columns.h"

namespace trammel::cli {

std::string plan_csv(const Cell& cell, const std::string& where, const Plan& plan) {
  JointList list{where, joint_types(cell.robot), {}};
  for (const PlannedPose& planned : plan.poses) {
    CommandedPose pose;
    pose.pose_id = planned.id;
    pose.context = planned.context;
    if (cell.tools.size() == 1) pose.context.tool.clear();
    if (cell.payloads.size() == 1) pose.context.payload.clear();
    list.poses.push_back(std::move(pose));
  }
  return to_csv(list);
}

}  // namespace trammel::cli
