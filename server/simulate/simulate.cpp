#include "server/simulate/simulate.h"

#include <random>

#include "server/base/units.h"

namespace trammel {

Result<MeasurementBatch> simulate(const VirtualRobot& robot, const Eigen::MatrixXd& q, const SimulateOptions& options) {
  const Cell& cell = *robot.truth.cell;
  if (q.cols() != cell.robot.size()) {
    return refused("simulate: {} joint columns, robot {} has {}", q.cols(), cell.robot.name(), cell.robot.size());
  }
  const Result<std::string> tool = resolve_tool(cell, options.tool);
  if (!tool) return tl::make_unexpected(tool.error());
  const Result<std::string> payload = resolve_payload(cell, options.payload);
  if (!payload) return tl::make_unexpected(payload.error());

  std::mt19937_64 random(options.seed);
  std::normal_distribution<double> normal(0, 1);
  const auto noise = [&](double sigma) {
    const Vector3 v(normal(random), normal(random), normal(random));
    return Vector3(options.noise ? (sigma * v).eval() : Vector3::Zero().eval());
  };
  MeasurementBatch batch;
  for (Eigen::Index i = 0; i < q.rows(); ++i) {
    Measurement m;
    m.pose_id = std::to_string(i + 1);
    m.row = static_cast<int>(i) + 2;
    m.context.q = q.row(i).transpose();
    m.context.tool = *tool;
    m.context.payload = *payload;
    m.context.index = static_cast<int>(i);
    if (const auto joint = cell.robot.joint_outside_limits(m.context.q)) {
      return refused("simulate: pose {}: joint {} is {:.3f} deg, limits {:.1f} and {:.1f}", i + 1, *joint + 1,
                     to_deg(m.context.q(*joint)), to_deg(cell.robot.joint(*joint).lower),
                     to_deg(cell.robot.joint(*joint).upper));
    }
    const Pose X_WT = robot.truth.pose_W(m.context);
    m.p_W = X_WT.translation() + noise(robot.sigma);
    const Matrix3 R_WT = rotation_exp(noise(robot.sigma_rotation)) * X_WT.linear();
    if (options.orientation) m.R_WT = R_WT;
    batch.measurements.push_back(std::move(m));
  }
  return batch;
}

}  // namespace trammel
