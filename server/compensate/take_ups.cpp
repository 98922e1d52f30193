#include "server/compensate/take_ups.h"

#include <algorithm>
#include <cmath>

#include "server/compensate/accuracy.h"

namespace trammel {

namespace {

constexpr int kSeenAt = 20;             // of the model's range, over which the play is evaluated
constexpr double kShortestLever = 0.1;  // m: nearer to the axis, play has no visible effect
constexpr double kNoPlay = 1e-7;        // rad: 0.2 µm at 2 m
constexpr double kTimesPlay = 5;        // a servo turns back by less than the commanded way
constexpr double kLeastWay = from_deg(0.1);  // likewise

/// rad (m): the largest distance of the joint from its motor, by the way it moves the tool.
double largest_play(const CompensatedModel& model, int joint,
                    const std::vector<PoseContext>& poses) {
  const PhysicalModel& physics = model.parts().physics;
  double most = 0;
  for (PoseContext context : poses) {
    const Vector3 p_F = physics.tools.at(context.tool).translation();
    const double lever =
        model.cell().robot.gear_jacobian(context.q, p_F).col(joint).head<3>().norm();
    if (lever < kShortestLever) continue;
    const Vector3 neither = physics.pose_W(context).translation();
    context.direction.assign(static_cast<std::size_t>(context.q.size()), 0);
    context.direction[static_cast<std::size_t>(joint)] = 1;
    most = std::max(most, (physics.pose_W(context).translation() - neither).norm() / lever);
  }
  return most;
}

int usual_side(const std::optional<WhatWasMeasured>& measured, int joint) {
  if (!measured) return 1;
  const auto& came = measured->approaches[static_cast<std::size_t>(joint)];
  return came.falling > came.rising ? -1 : 1;
}

}  // namespace

std::vector<TakeUp> take_ups(const CompensatedModel& model) {
  std::vector<double> ways(static_cast<std::size_t>(model.cell().robot.size()), 0);
  const std::vector<PoseContext> poses = poses_in_range(model, kSeenAt);
  for (const ErrorSourcePtr& source : model.parts().physics.sources) {
    if (source->joint() < 0) continue;
    double& way = ways[static_cast<std::size_t>(source->joint())];
    const ContextNeeds needs = source->needs();
    if (needs.before) way = std::max(way, kSaidMove);
    if (!needs.direction) continue;
    const double play = 2 * largest_play(model, source->joint(), poses);
    if (play > kNoPlay) way = std::max({way, kTimesPlay * play, kLeastWay});
  }
  std::vector<TakeUp> all;
  for (std::size_t j = 0; j < ways.size(); ++j) {
    const int joint = static_cast<int>(j);
    if (ways[j] > 0) all.push_back({joint, ways[j], usual_side(model.parts().measured, joint)});
  }
  return all;
}

}  // namespace trammel
