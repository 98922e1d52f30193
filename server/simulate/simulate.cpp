#include "server/simulate/simulate.h"

#include <cmath>
#include <random>

#include "server/base/units.h"

namespace trammel {

namespace {

/// Refuses joints that the robot has not or cannot take.
Status check_joints(const JointVector& q, int index, const Chain& robot) {
  if (q.size() != robot.size()) {
    return refused("simulate: {} joints, robot {} has {}", q.size(), robot.name(), robot.size())
        .beyond(q.size(), robot.size());
  }
  const auto joint = robot.joint_outside_limits(q);
  if (!joint) return {};
  const Joint& known = robot.joint(*joint);
  const double value = q(*joint);
  return refused("simulate: pose {}: joint {} is {:.3f} deg, limits {:.1f} and {:.1f}", index + 1,
                 *joint + 1, to_deg(value), to_deg(known.lower), to_deg(known.upper))
      .of(fmt::format("q{}_deg", *joint + 1))
      .beyond(to_deg(value), to_deg(value < known.lower ? known.lower : known.upper));
}

/// `pose` completed by the options and the course: tool, payload, time and temperature.
Result<PoseContext> completed(PoseContext pose, int index, const VirtualRobot& robot,
                              const SimulateOptions& options) {
  const Cell& cell = *robot.truth.cell;
  TRY(check_joints(pose.q, index, cell.robot));
  const std::string tool = TRY(resolve_tool(cell, pose.tool.empty() ? options.tool : pose.tool));
  const std::string payload =
      TRY(resolve_payload(cell, pose.payload.empty() ? options.payload : pose.payload));
  pose.tool = tool;
  pose.payload = payload;
  pose.index = index;
  const MeasuringCourse& course = robot.course;
  if (!pose.time && course.seconds_per_pose > 0) pose.time = index * course.seconds_per_pose;
  if (!pose.temperature && course.temperature_start) {
    const double warmed = 1 - std::exp(-pose.time.value_or(0) / course.temperature_time_constant);
    pose.temperature =
        *course.temperature_start + warmed * (course.temperature_end - *course.temperature_start);
  }
  return pose;
}

}  // namespace

Result<MeasurementBatch> simulate(const VirtualRobot& robot, const std::vector<PoseContext>& poses,
                                  const SimulateOptions& options) {
  std::mt19937_64 random(options.seed);
  std::normal_distribution<double> normal(0, 1);
  const auto noise = [&](double sigma) {
    const Vector3 v(normal(random), normal(random), normal(random));
    return Vector3(options.noise ? (sigma * v).eval() : Vector3::Zero().eval());
  };
  MeasurementBatch batch;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    PoseContext context = TRY(completed(poses[i], static_cast<int>(i), robot, options));
    Measurement m;
    m.pose_id = std::to_string(i + 1);
    m.row = static_cast<int>(i) + 2;
    m.context = std::move(context);
    const Pose X_WT = robot.truth.pose_W(m.context);
    m.p_W = X_WT.translation() + noise(robot.sigma);
    const Matrix3 R_WT = rotation_exp(noise(robot.sigma_rotation)) * X_WT.linear();
    if (options.orientation) m.R_WT = R_WT;
    batch.measurements.push_back(std::move(m));
  }
  return batch;
}

Result<MeasurementBatch> simulate(const VirtualRobot& robot, const Eigen::MatrixXd& q,
                                  const SimulateOptions& options) {
  std::vector<PoseContext> poses(static_cast<std::size_t>(q.rows()));
  for (Eigen::Index i = 0; i < q.rows(); ++i)
    poses[static_cast<std::size_t>(i)].q = q.row(i).transpose();
  return simulate(robot, poses, options);
}

}  // namespace trammel
