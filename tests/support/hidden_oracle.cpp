#include "tests/support/hidden_oracle.h"

#include <algorithm>
#include <cmath>

namespace trammel::hidden {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

MatrixXd side_by_side(const MatrixXd& left, const MatrixXd& right) {
  MatrixXd both(left.rows(), left.cols() + right.cols());
  both << left, right;
  return both;
}

/// Every column over its length, times `length`.
MatrixXd of_length(MatrixXd columns, double length) {
  for (Index k = 0; k < columns.cols(); ++k) {
    const double is = columns.col(k).norm();
    if (is > 0) columns.col(k) *= length / is;
  }
  return columns;
}

Scene scene_of(const World& world) {
  Scene scene{world.arm, &world.poses, static_cast<int>(world.tools.size()),
              static_cast<int>(world.loads.size()), true};
  scene.arm.tool = world.tools.front();
  scene.arm.load = world.loads.front();
  return scene;
}

MatrixXd rival_columns(const World& world, const HiddenCause& cause,
                       const std::vector<MeasuringPose>& poses) {
  Random random(1);  // sizes only: columns are derivatives
  return effect_columns(world, poses, draw_effect(cause, scene_of(world), random));
}

/// The causes as they would act if those that begin at a pose acted from the first one on.
std::vector<HiddenCause> steady_causes(const World& world) {
  std::vector<HiddenCause> causes = {{"wrist_coupling", 0, "", -1, {}},
                                     {"thermal_growth", 0, "", -1, {}},
                                     {"tracker_drift", 0, "", -1, {}},
                                     {"tool", 0, "", -1, {}}};
  for (int joint = 1; joint <= kJoints; ++joint) {
    causes.push_back({"encoder_eccentricity", joint, "", -1, {}});
    causes.push_back({"backlash", joint, "", -1, {}});
  }
  for (const int joint : {1, 2, 3, 4, 6}) causes.push_back({"link_bending", joint, "", -1, {}});
  if (world.loads.size() > 1) causes.push_back({"payload", 0, "", -1, {}});
  for (const ArmParameter& parameter : arm_parameters()) {
    const auto& known = world.sources;
    const bool identified = std::find(known.begin(), known.end(), parameter.group) != known.end();
    if (!identified && parameter.group != "base")
      causes.push_back({parameter.group, 0, parameter.name, -1, {}});
  }
  return causes;
}

std::vector<HiddenCause> sudden_causes() {
  std::vector<HiddenCause> causes;
  for (const char* name : {"tracker_moved", "tool_changed", "payload_changed"})
    causes.push_back({name, 0, "", 0, {}});
  for (int joint = 1; joint <= kJoints; ++joint) causes.push_back({"joint_slip", joint, "", 0, {}});
  return causes;
}

/// Share of `effect` that `columns` cannot explain. Both are without their parts along `nuisance`.
double share_left(const VectorXd& effect, const MatrixXd& columns) {
  const MatrixXd directions = directions_of(of_length(columns, 1e4));
  return outside(directions, effect).squaredNorm() / effect.squaredNorm();
}

bool same(const HiddenCause& one, const HiddenCause& other) {
  if (one.cause != other.cause || one.parameter != other.parameter) return false;
  return !one.parameter.empty() || one.joint == other.joint;
}

VectorXd rows_of(const World& world, const std::vector<MeasuringPose>& poses) {
  return whitened(world, frames_at(world, poses, world.effects), frames_at(world, poses, {}));
}

}  // namespace

double held_out_rms_mm(const HiddenCase& hidden) {
  const World& world = hidden.world;
  std::vector<MeasuringPose> learned, kept;
  Frames measured_learned, measured_kept;
  for (std::size_t i = 0; i < world.poses.size(); ++i) {
    const bool validation = world.poses[i].validation;
    (validation ? kept : learned).push_back(world.poses[i]);
    (validation ? measured_kept : measured_learned).push_back(hidden.measured[i]);
  }
  const auto columns = [&](const std::vector<MeasuringPose>& poses) {
    MatrixXd all = arm_columns(world, poses);
    for (const Effect& effect : world.effects) {
      MatrixXd more = effect_columns(world, poses, effect);
      for (Index k = 0; k < more.cols(); ++k) {  // by the size of the effect
        if (effect.grows[static_cast<std::size_t>(k)]) more.col(k) *= effect.values.norm();
      }
      all = side_by_side(all, more);
    }
    return all;
  };
  const VectorXd noise =
      whitened(world, measured_learned, frames_at(world, learned, world.effects));
  const Eigen::BDCSVD<MatrixXd> svd(columns(learned), Eigen::ComputeThinU | Eigen::ComputeThinV);
  const Index rank = (svd.singularValues().array() >= 1).count();
  const VectorXd along = (svd.matrixU().leftCols(rank).transpose() * noise).array() /
                         svd.singularValues().head(rank).array();
  const VectorXd left = whitened(world, measured_kept, frames_at(world, kept, world.effects)) -
                        columns(kept) * (svd.matrixV().leftCols(rank) * along);
  double sum = 0;
  const Index per_pose = left.size() / static_cast<Index>(kept.size());
  for (Index i = 0; i < static_cast<Index>(kept.size()); ++i)
    sum += left.segment<3>(per_pose * i).squaredNorm();
  return world.sigma_mm * std::sqrt(sum / static_cast<double>(kept.size()));
}

std::vector<Rival> closest_rivals(const HiddenCase& hidden) {
  const World& world = hidden.world;
  const std::vector<MeasuringPose>& poses = world.poses;
  const MatrixXd nuisance = directions_of(arm_columns(world, poses));
  const VectorXd effect = outside(nuisance, rows_of(world, poses));
  const HiddenCause& truth = hidden.truth.causes.front();
  std::vector<Rival> rivals;
  for (const HiddenCause& cause : steady_causes(world)) {
    if (same(cause, truth)) continue;
    const MatrixXd columns = rival_columns(world, cause, poses);
    rivals.push_back({cause, share_left(effect, outside(nuisance, columns)), columns.cols()});
  }
  const Index per_pose = effect.size() / static_cast<Index>(poses.size());
  const auto count = static_cast<int>(poses.size());
  for (HiddenCause cause : sudden_causes()) {
    if (same(cause, truth)) continue;
    MatrixXd columns = rival_columns(world, cause, poses);
    Rival best{cause, 1, columns.cols()};
    int cleared = 0;
    for (int first = count / 20; first < count - count / 20; first += std::max(1, count / 60)) {
      columns.middleRows(per_pose * cleared, per_pose * (first - cleared)).setZero();
      cleared = first;
      const double left = share_left(effect, outside(nuisance, columns));
      if (left >= best.left) continue;
      best.left = left;
      best.cause.first = first;
    }
    rivals.push_back(best);
  }
  std::sort(rivals.begin(), rivals.end(),
            [](const Rival& a, const Rival& b) { return a.left < b.left; });
  return rivals;
}

double relative_stddev(const HiddenCase& hidden, const std::vector<HiddenCause>& rivals,
                       const std::vector<MeasuringPose>& more) {
  const World& world = hidden.world;
  std::vector<MeasuringPose> poses = world.poses;
  poses.insert(poses.end(), more.begin(), more.end());
  MatrixXd beside = directions_of(arm_columns(world, poses)) * 1e4;
  for (const HiddenCause& rival : rivals)
    beside = side_by_side(beside, of_length(rival_columns(world, rival, poses), 1e4));
  return 1 / outside(directions_of(beside), rows_of(world, poses)).norm();
}

}  // namespace trammel::hidden
