#include "tests/support/hidden_panel.h"

#include <cmath>

namespace trammel::hidden {

namespace {

using Eigen::Index;
using Eigen::Matrix4d;

constexpr int kColumns = 5;
constexpr int kRows = 7;
constexpr double kWidth_mm = 500;
constexpr double kHeight_mm = 1200;
constexpr double kSecondsAHole = 25;

/// [shift in mm; turn in units of a metre's arc in mm] from `is` to `wanted`.
Joints gap(const Matrix4d& is, const Matrix4d& wanted) {
  Joints rows;
  rows.head<3>() = (wanted - is).block<3, 1>(0, 3);
  const Eigen::AngleAxisd turn(
      Eigen::Matrix3d(wanted.block<3, 3>(0, 0) * is.block<3, 3>(0, 0).transpose()));
  rows.tail<3>() = 1000 * turn.angle() * turn.axis();
  return rows;
}

/// Newton's method on finite differences.
Joints joints_for(const Arm& arm, const Matrix4d& wanted, Joints q) {
  constexpr double kStep = 1e-6;
  for (int round = 0; round < 50; ++round) {
    const Matrix4d is = tool_frame(arm, q);
    const Joints missing = gap(is, wanted);
    if (missing.norm() < 1e-9) break;
    Eigen::Matrix<double, kJoints, kJoints> slope;
    for (Index j = 0; j < kJoints; ++j) {
      Joints other = q;
      other(j) += kStep;
      slope.col(j) = gap(is, tool_frame(arm, other)) / kStep;
    }
    Joints step = slope.fullPivLu().solve(missing);
    if (step.norm() > 0.3) step *= 0.3 / step.norm();
    q += step;
  }
  return q;
}

}  // namespace

std::vector<MeasuringPose> panel_poses(const World& world, Random& random) {
  Arm arm = drawn_arm();
  arm.tool = world.tools.front();
  Joints q;
  q << 0.05, 0.15, -0.1, 0.1, 0.6, 0.05;
  const Matrix4d middle = tool_frame(arm, q);
  std::vector<MeasuringPose> poses;
  Joints before = q;
  for (int row = 0; row < kRows; ++row) {
    for (int column = 0; column < kColumns; ++column) {
      MeasuringPose pose;
      pose.index = static_cast<int>(poses.size());
      Matrix4d wanted = middle;
      wanted(1, 3) += kWidth_mm * (column / (kColumns - 1.0) - 0.5);
      wanted(2, 3) += kHeight_mm * (row / (kRows - 1.0) - 0.5);
      pose.q = joints_for(arm, wanted, q);
      for (Index j = 0; j < kJoints; ++j)
        pose.direction[static_cast<std::size_t>(j)] = pose.q(j) > before(j) ? 1 : -1;
      before = pose.q;
      pose.time_s = kSecondsAHole * (pose.index + uniform(random, 0, 0.2));
      pose.temperature_c = 21 + 0.3 * std::sin(pose.time_s / 300);
      pose.link_temperature_c = pose.temperature_c;
      poses.push_back(pose);
    }
  }
  return poses;
}

}  // namespace trammel::hidden
