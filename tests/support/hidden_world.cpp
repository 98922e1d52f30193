#include "tests/support/hidden_world.h"

#include <algorithm>
#include <cmath>

namespace trammel::hidden {

namespace {

using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::Matrix4d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr double kStep = 1e-3;  // of finite differences, in reasonable changes

/// The vector whose direction is the axis and whose length is the angle, of a small rotation.
Vector3d small_turn(const Matrix3d& R) {
  const Vector3d twice(R(2, 1) - R(1, 2), R(0, 2) - R(2, 0), R(1, 0) - R(0, 1));
  return twice / 2;
}

Matrix4d frame_at(const World& world, const MeasuringPose& pose,
                  const std::vector<Effect>& effects) {
  Moment moment;
  moment.arm = world.arm;
  moment.arm.tool = world.tools[static_cast<std::size_t>(pose.tool)];
  moment.arm.load = world.loads[static_cast<std::size_t>(pose.load)];
  moment.q = pose.q;
  for (const Effect& effect : effects) effect.act(pose, effect.values, moment);
  Matrix4d frame = moment.seen * tool_frame(moment.arm, moment.q);
  frame.block<3, 1>(0, 3) += moment.shift;
  return frame;
}

/// Central difference per unit: the effect of `steps` up minus that of `steps` down.
template <typename FramesAt>
VectorXd central(const World& world, double steps, FramesAt frames_of) {
  return whitened(world, frames_of(1.0), frames_of(-1.0)) / (2 * steps);
}

}  // namespace

Frames frames_at(const World& world, const std::vector<MeasuringPose>& poses,
                 const std::vector<Effect>& effects) {
  Frames frames;
  frames.reserve(poses.size());
  for (const MeasuringPose& pose : poses) frames.push_back(frame_at(world, pose, effects));
  return frames;
}

VectorXd whitened(const World& world, const Frames& moved, const Frames& still) {
  const Index rows = world.orientation ? 6 : 3;
  VectorXd difference(rows * static_cast<Index>(moved.size()));
  for (std::size_t i = 0; i < moved.size(); ++i) {
    const Index row = rows * static_cast<Index>(i);
    difference.segment<3>(row) = (moved[i] - still[i]).block<3, 1>(0, 3) / world.sigma_mm;
    if (!world.orientation) continue;
    const Matrix3d turned = moved[i].block<3, 3>(0, 0) * still[i].block<3, 3>(0, 0).transpose();
    difference.segment<3>(row + 3) = small_turn(turned) / world.sigma_rad;
  }
  return difference;
}

MatrixXd arm_columns(const World& world, const std::vector<MeasuringPose>& poses) {
  const auto& all = arm_parameters();
  MatrixXd columns(static_cast<Index>(poses.size()) * (world.orientation ? 6 : 3), 0);
  for (std::size_t k = 0; k < all.size(); ++k) {
    if (std::find(world.sources.begin(), world.sources.end(), all[k].group) == world.sources.end())
      continue;
    columns.conservativeResize(Eigen::NoChange, columns.cols() + 1);
    columns.rightCols(1) = central(world, kStep, [&](double way) {
      VectorXd values = VectorXd::Zero(static_cast<Index>(all.size()));
      values(static_cast<Index>(k)) = way * kStep * all[k].unit;
      World other = world;
      other.arm = changed(world.arm, values);
      return frames_at(other, poses, {});
    });
  }
  return columns;
}

MatrixXd effect_columns(const World& world, const std::vector<MeasuringPose>& poses,
                        const Effect& effect) {
  MatrixXd columns(static_cast<Index>(poses.size()) * (world.orientation ? 6 : 3),
                   effect.values.size());
  for (Index k = 0; k < effect.values.size(); ++k) {
    const double size = effect.grows[static_cast<std::size_t>(k)] ? effect.values.norm() : 1e-2;
    columns.col(k) = central(world, kStep, [&](double way) {
      Effect other = effect;
      other.values(k) += way * kStep * size;
      return frames_at(world, poses, {other});
    });
  }
  return columns;
}

MatrixXd directions_of(const MatrixXd& columns) {
  if (columns.cols() == 0) return columns;
  const Eigen::HouseholderQR<MatrixXd> qr(columns);
  const Index rank = std::min(columns.rows(), columns.cols());
  const MatrixXd R = qr.matrixQR().topRows(rank).triangularView<Eigen::Upper>();
  const Eigen::JacobiSVD<MatrixXd> svd(R, Eigen::ComputeThinU);
  const Index kept = (svd.singularValues().array() >= 1).count();
  return qr.householderQ() * MatrixXd::Identity(columns.rows(), rank) *
         svd.matrixU().leftCols(kept);
}

MatrixXd outside(const MatrixXd& directions, const MatrixXd& rows) {
  if (directions.cols() == 0) return rows;
  return rows - directions * (directions.transpose() * rows);
}

std::vector<MeasuringPose> training_poses(const World& world) {
  std::vector<MeasuringPose> poses;
  std::copy_if(world.poses.begin(), world.poses.end(), std::back_inserter(poses),
               [](const MeasuringPose& pose) { return !pose.validation; });
  return poses;
}

}  // namespace trammel::hidden
