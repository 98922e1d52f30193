#include "tests/support/hidden_check.h"

#include <algorithm>
#include <cmath>

namespace trammel::hidden {

namespace {

using Eigen::Index;
using Eigen::Matrix4d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr int kWorkingPoses = 300;

/// The ratio of one reading's noise to the usual: 1, or random such that each coordinate has
/// Student's t of variance 1.
double disturbance(const RobotSpec& spec, Random& random) {
  const auto freedom = static_cast<int>(spec.tail_freedom);
  if (freedom <= 2) return 1;
  double square = 0;
  for (int k = 0; k < freedom; ++k) {
    const double z = normal(random);
    square += z * z;
  }
  return std::sqrt((freedom - 2.0) / square);
}

Frames noisy(const World& world, const RobotSpec& spec, Frames frames, Random& random) {
  for (Matrix4d& frame : frames) {
    const double size = disturbance(spec, random);
    Vector3d turn;
    for (Index k = 0; k < 3; ++k) {
      frame(k, 3) += size * world.sigma_mm * normal(random);
      turn(k) = size * world.sigma_rad * normal(random);
    }
    const Matrix4d turned = motion(Vector3d::Zero(), turn.z(), turn.y(), turn.x());
    frame.block<3, 3>(0, 0) = (turned * frame).block<3, 3>(0, 0).eval();
  }
  return frames;
}

VectorXd draw_errors(const std::vector<std::string>& sources, Random& random) {
  constexpr double kGive[kJoints] = {1e-10, 2.8e-10, 1.5e-9, 2e-9, 2.8e-9, 2.8e-9};  // rad/Nmm
  const auto& all = arm_parameters();
  VectorXd errors = VectorXd::Zero(static_cast<Index>(all.size()));
  for (std::size_t k = 0; k < all.size(); ++k) {
    if (std::find(sources.begin(), sources.end(), all[k].group) == sources.end()) continue;
    errors(static_cast<Index>(k)) =
        all[k].group == "compliance"
            ? kGive[all[k].name.at(1) - '1'] * std::exp(0.4 * normal(random))
            : 0.15 * all[k].unit * normal(random);
  }
  return errors;
}

std::vector<MeasuringPose> working_poses(const RobotSpec& spec) {
  Random random(spec.seed * 7 + 12345);
  PosePlan plan;
  plan.count = kWorkingPoses;
  plan.constant_temperature = true;
  return draw_poses(plan, random);
}

Scene scene_of(const TrainedRobot& robot, const std::vector<MeasuringPose>& poses) {
  Scene scene{robot.world.arm, &poses, 1, 1, true};
  scene.arm.tool = robot.world.tools.front();
  scene.arm.load = robot.world.loads.front();
  return scene;
}

/// Positions, mm.
VectorXd positions(const Frames& frames) {
  VectorXd all(3 * static_cast<Index>(frames.size()));
  for (std::size_t i = 0; i < frames.size(); ++i)
    all.segment<3>(3 * static_cast<Index>(i)) = frames[i].block<3, 1>(0, 3);
  return all;
}

/// The changes of positions by a motion of the base, and by one of the tool.
MatrixXd frame_columns(const TrainedRobot& robot, const std::vector<MeasuringPose>& poses,
                       bool new_tool) {
  const Frames still = frames_at(robot.world, poses, {});
  MatrixXd columns(3 * static_cast<Index>(poses.size()), new_tool ? 9 : 6);
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const Index row = 3 * static_cast<Index>(i);
    const Vector3d p = still[i].block<3, 1>(0, 3);
    columns.block<3, 3>(row, 0).setIdentity();
    for (Index axis = 0; axis < 3; ++axis)
      columns.block<3, 1>(row, 3 + axis) = Vector3d::Unit(axis).cross(p) / 1000;
    // A tool that is turned about its own point moves none.
    if (new_tool) columns.block<3, 3>(row, 6) = still[i].block<3, 3>(0, 0);
  }
  return columns;
}

}  // namespace

TrainedRobot draw_robot(const RobotSpec& spec) {
  Random random(spec.seed * 1000 + 77);
  return robot_with(spec, changed(drawn_arm(), draw_errors(spec.sources, random)));
}

TrainedRobot robot_with(const RobotSpec& spec, const Arm& arm) {
  Random random(spec.seed * 1000 + 78);
  TrainedRobot robot;
  robot.spec = spec;
  World& world = robot.world;
  world.sources = spec.sources;
  world.orientation = spec.orientation;
  world.sigma_mm = spec.sigma_mm;
  world.arm = arm;
  robot.belief.tools = {motion({100, 0, 150}, 0, -0.785, 0)};
  robot.belief.loads = {{100, {40, -25, 140}}};
  world.tools = robot.belief.tools;
  world.loads = robot.belief.loads;
  PosePlan plan;
  plan.count = spec.poses;
  plan.constant_temperature = true;
  world.poses = draw_poses(plan, random);
  if (spec.ripple_mm > 0) {
    Effect always =
        draw_effect({"unknown", 0, "", -1, {"q2", "q3"}}, scene_of(robot, world.poses), random);
    always.values(0) = spec.ripple_mm / std::sqrt(3.0);
    world.effects.push_back(always);
  }
  robot.robot_yaml = robot_text();
  robot.cell_yaml = cell_text(world, robot.belief, plan.ranges);
  robot.batch_csv =
      batch_text(world, noisy(world, spec, frames_at(world, world.poses, world.effects), random));
  return robot;
}

double left_rms_mm(const TrainedRobot& robot, const std::vector<Effect>& effects, bool new_tool) {
  const std::vector<MeasuringPose> poses = working_poses(robot.spec);
  const VectorXd moved = positions(frames_at(robot.world, poses, effects)) -
                         positions(frames_at(robot.world, poses, {}));
  const MatrixXd columns = frame_columns(robot, poses, new_tool);
  const VectorXd left = moved - columns * columns.colPivHouseholderQr().solve(moved);
  return left.norm() / std::sqrt(static_cast<double>(poses.size()));
}

Effect changed_by(const TrainedRobot& robot, const HiddenCause& cause, double rms_mm, bool new_tool,
                  Random& random) {
  constexpr int kRounds = 6;
  const std::vector<MeasuringPose> poses = working_poses(robot.spec);
  HiddenCause always = cause;
  if (always.first >= 0) always.first = 0;
  Effect effect = draw_effect(always, scene_of(robot, poses), random);
  for (int round = 0; round < kRounds; ++round) {
    const double by = rms_mm / std::max(left_rms_mm(robot, {effect}, new_tool), 1e-12);
    for (std::size_t v = 0; v < effect.grows.size(); ++v) {
      if (effect.grows[v]) effect.values(static_cast<Index>(v)) *= by;
    }
  }
  return effect;
}

std::string check_csv(const TrainedRobot& robot, const CheckSpec& check, Random& random) {
  World world = robot.world;
  world.poses.clear();
  for (const Joints& q : check.q) {
    MeasuringPose pose;
    pose.index = static_cast<int>(world.poses.size());
    pose.q = q;
    pose.time_s = 30.0 * pose.index;
    pose.direction.fill(-1);
    world.poses.push_back(pose);
  }
  std::vector<Effect> effects = robot.world.effects;
  effects.insert(effects.end(), check.effects.begin(), check.effects.end());
  Frames frames = noisy(world, robot.spec, frames_at(world, world.poses, effects), random);
  const Matrix4d stand =
      motion({uniform(random, -500, 500), uniform(random, -500, 500), uniform(random, -200, 200)},
             uniform(random, -0.4, 0.4), 0.01 * normal(random), 0.01 * normal(random));
  for (Matrix4d& frame : frames) frame = stand * frame;
  if (check.bad_pose >= 0) {
    Vector3d off(normal(random), normal(random), normal(random));
    frames[static_cast<std::size_t>(check.bad_pose)].block<3, 1>(0, 3) +=
        check.bad_mm * off.normalized();
  }
  return batch_text(world, frames);
}

}  // namespace trammel::hidden
