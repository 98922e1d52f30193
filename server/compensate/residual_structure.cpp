#include "server/compensate/residual_structure.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "server/compensate/bias_physics.h"
#include "server/measurement/pose_groups.h"

namespace trammel {

using Eigen::Index;
using Eigen::VectorXd;

namespace {

/// Adds what `values`, in their order, show of runs about their mean.
void add_runs(const VectorXd& values, ResidualOrder& order) {
  const Index n = values.size();
  if (n < 2) return;
  const VectorXd centred = values.array() - values.mean();
  double above = 0;
  double runs = 1;
  for (Index i = 0; i < n; ++i) {
    above += centred(i) > 0 ? 1 : 0;
    if (i > 0 && (centred(i) > 0) != (centred(i - 1) > 0)) ++runs;
  }
  const double both = 2 * above * (static_cast<double>(n) - above);
  const auto count = static_cast<double>(n);
  order.runs += runs;
  order.expected += both / count + 1;
  order.stddev =
      std::hypot(order.stddev, std::sqrt(both * (both - count) / (count * count * (count - 1))));
}

double correlation_of_next(const Eigen::MatrixXd& rows) {
  const Eigen::MatrixXd centred = rows.colwise() - rows.rowwise().mean();
  const Index n = centred.cols();
  if (n < 2 || centred.isZero(0)) return 0;
  return centred.leftCols(n - 1).cwiseProduct(centred.rightCols(n - 1)).sum() /
         centred.squaredNorm();
}

/// m: how far each pose is off in the direction in which the joint moves the tool.
VectorXd along_joint(const CompensatedModel& model, const MeasurementBatch& batch,
                     const Eigen::Matrix3Xd& residual_B, int joint) {
  const Chain& robot = model.cell().robot;
  VectorXd along(residual_B.cols());
  for (Index i = 0; i < along.size(); ++i) {
    const PoseContext& context = batch.measurements[static_cast<std::size_t>(i)].context;
    const Vector3 p_FT = served_tool(model.parts().physics, context.tool).translation();
    const Vector3 way = robot.gear_jacobian(context.q, p_FT).col(joint).head<3>();
    along(i) = way.norm() > 0 ? residual_B.col(i).dot(way.normalized()) : 0;
  }
  return along;
}

/// The poses, each with the mean residual of the rows at its joint vector. Rows of one pose share a
/// sign, which is not structure.
std::pair<MeasurementBatch, Eigen::Matrix3Xd> one_a_pose(const MeasurementBatch& batch,
                                                         const Eigen::Matrix3Xd& residual_B) {
  const std::vector<PoseGroup> poses = pose_groups(batch);
  MeasurementBatch first = batch;
  first.measurements.clear();
  Eigen::Matrix3Xd mean_B(3, std::ssize(poses));
  for (Index p = 0; p < std::ssize(poses); ++p) {
    const PoseGroup& rows = poses[static_cast<std::size_t>(p)];
    first.measurements.push_back(batch.measurements[static_cast<std::size_t>(rows.front())]);
    mean_B.col(p) = residual_B(Eigen::all, rows).rowwise().mean();
  }
  return {std::move(first), std::move(mean_B)};
}

ResidualOrder order_of_joint(const Chain& robot, const MeasurementBatch& batch,
                             const VectorXd& along, int joint) {
  std::vector<Index> sorted(static_cast<std::size_t>(along.size()));
  std::iota(sorted.begin(), sorted.end(), Index{0});
  const auto angle = [&](Index i) {
    return robot.gear_angles(batch.measurements[static_cast<std::size_t>(i)].context.q)(joint);
  };
  std::stable_sort(sorted.begin(), sorted.end(),
                   [&](Index a, Index b) { return angle(a) < angle(b); });
  ResidualOrder order;
  order.joint = joint;
  const VectorXd in_order = along(sorted);
  add_runs(in_order, order);
  order.correlation = correlation_of_next(in_order.transpose());
  return order;
}

}  // namespace

std::vector<ResidualOrder> residual_orders(const CompensatedModel& model,
                                           const MeasurementBatch& given,
                                           const Eigen::Matrix3Xd& residual_of_rows_B) {
  const auto [batch, residual_B] = one_a_pose(given, residual_of_rows_B);
  ResidualOrder rows;
  for (int axis = 0; axis < 3; ++axis) add_runs(residual_B.row(axis).transpose(), rows);
  rows.correlation = correlation_of_next(residual_B);
  std::vector<ResidualOrder> orders = {rows};
  const Chain& robot = model.cell().robot;
  for (int joint = 0; joint < robot.size(); ++joint) {
    if (robot.joint(joint).type == JointType::kRevolute)
      orders.push_back(
          order_of_joint(robot, batch, along_joint(model, batch, residual_B, joint), joint));
  }
  return orders;
}

std::optional<ResidualOrder> most_structured(const std::vector<ResidualOrder>& orders) {
  const auto farthest = std::max_element(
      orders.begin(), orders.end(),
      [](const ResidualOrder& a, const ResidualOrder& b) { return a.z() < b.z(); });
  if (farthest == orders.end() || farthest->z() <= ResidualOrder::kBeyondChance)
    return std::nullopt;
  return *farthest;
}

std::string in_words(const ResidualOrder& order) {
  const std::string by = order.joint < 0 ? "from row to row"
                                         : fmt::format("in the order of joint {}", order.joint + 1);
  return fmt::format(
      "what the calibrated model leaves here is no noise: {} it keeps its sign, {:.0f} stretches "
      "where noise makes {:.0f} ± {:.0f} (run test), correlation from one pose to the next {:.2f}; "
      "the parameters are less certain than their U(k=2) says",
      by, order.runs, order.expected, 2 * order.stddev, order.correlation);
}

}  // namespace trammel
