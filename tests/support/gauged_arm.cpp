#include "tests/support/gauged_arm.h"

#include <cmath>
#include <numbers>

#include "server/base/units.h"
#include "server/robot/rigid_fit.h"
#include "tests/support/demand.h"
#include "tests/support/hidden_files.h"

namespace trammel::test {

namespace {

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kNearest = 300, kFarthest = 3000;  // mm
constexpr int kAskedPoses = 150;

/// The world's arm with its parameters moved by `values`, at a pose: tool point, mm.
Eigen::Vector3d point_of(const hidden::Arm& arm, const hidden::World& world,
                         const hidden::MeasuringPose& pose) {
  hidden::Arm one = arm;
  one.tool = world.tools[static_cast<std::size_t>(pose.tool)];
  one.load = world.loads[static_cast<std::size_t>(pose.load)];
  return hidden::tool_frame(one, pose.q).block<3, 1>(0, 3);
}

/// 3 x P: derivative of the tool point by every parameter, in units that it may reasonably be off
/// by.
Eigen::MatrixXd point_columns(const GaugedArm& arm, const hidden::MeasuringPose& pose) {
  constexpr double kStep = 1e-3;
  const auto& all = hidden::arm_parameters();
  const auto P = static_cast<Eigen::Index>(all.size());
  Eigen::MatrixXd columns(3, P);
  for (Eigen::Index k = 0; k < P; ++k) {
    Eigen::VectorXd step = Eigen::VectorXd::Zero(P);
    step(k) = kStep * all[static_cast<std::size_t>(k)].unit;
    columns.col(k) = (point_of(hidden::changed(arm.world.arm, step), arm.world, pose) -
                      point_of(hidden::changed(arm.world.arm, -step), arm.world, pose)) /
                     (2 * kStep);
  }
  return columns;
}

std::vector<hidden::MeasuringPose> some_poses(int count, std::uint64_t seed) {
  hidden::Random random(seed * 7919 + 3);
  hidden::PosePlan plan;
  plan.count = count;
  plan.constant_temperature = true;
  return hidden::draw_poses(plan, random);
}

/// Removes from `rows` (3 N x anything) the part that a small rigid motion of all points makes.
Eigen::MatrixXd without_motion(const Eigen::Matrix3Xd& points, const Eigen::MatrixXd& rows) {
  Eigen::MatrixXd motion(rows.rows(), 6);
  const Eigen::Vector3d mean = points.rowwise().mean();
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    motion.block<3, 3>(3 * i, 0) = Eigen::Matrix3d::Identity();
    motion.block<3, 3>(3 * i, 3) = -1e-3 * skew(points.col(i) - mean);
  }
  return rows - motion * motion.colPivHouseholderQr().solve(rows);
}

}  // namespace

std::map<std::string, Eigen::Vector3d> three_corners() {
  return {{"a1", {2300, -1500, 100}}, {"a2", {1900, 1700, 400}}, {"a3", {2600, 200, 2600}}};
}

std::string unknown_places(const std::map<std::string, Eigen::Vector3d>& anchors_mm) {
  std::string text;
  for (const auto& [id, p] : anchors_mm)
    text += (text.empty() ? "" : ", ") + id + ": {xyz_mm: null}";
  return "{" + text + "}";
}

GaugedArm gauged_arm(std::uint64_t seed, const std::map<std::string, Eigen::Vector3d>& anchors_mm,
                     const std::string& anchors_yaml, const std::string& more) {
  hidden::Random random(seed * 1013 + 7);
  GaugedArm arm;
  arm.anchors_mm = anchors_mm;
  arm.world.arm = hidden::drawn_arm();
  const auto& all = hidden::arm_parameters();
  Eigen::VectorXd errors(static_cast<Eigen::Index>(all.size()));
  for (std::size_t k = 0; k < all.size(); ++k) {
    const double size =
        all[k].group == "compliance" ? std::abs(hidden::normal(random)) : hidden::normal(random);
    errors(static_cast<Eigen::Index>(k)) = size * all[k].unit;
  }
  arm.world.arm = hidden::changed(arm.world.arm, errors);
  arm.world.sources = {"base", "geometry", "compliance"};
  arm.world.tools = {hidden::motion({100, 0, 150}, 0, -std::numbers::pi / 4, 0)};
  arm.world.loads = {{100, {40, -25, 140}}};
  arm.world.orientation = false;
  std::string known;
  for (const auto& [id, p] : anchors_mm)
    known += fmt::format("{}{}: {{xyz_mm: [{:.9g}, {:.9g}, {:.9g}]}}", known.empty() ? "" : ", ",
                         id, p.x(), p.y(), p.z());
  const std::string text =
      hidden::cell_text(arm.world, {arm.world.tools, arm.world.loads}, "calibration") +
      "anchors: " + (anchors_yaml.empty() ? "{" + known + "}" : anchors_yaml) + "\n" + more;
  arm.cell =
      std::make_shared<const Cell>(demand(parse_cell(text, hidden::robot_text(), "gauged.yaml")));
  return arm;
}

std::vector<GaugeRow> wire_rows(const GaugedArm& arm, int count, std::uint64_t seed,
                                double zero_mm) {
  std::vector<GaugeRow> rows;
  auto anchor = arm.anchors_mm.begin();
  for (const hidden::MeasuringPose& pose : some_poses(20 * count, seed)) {
    if (static_cast<int>(rows.size()) == count) break;
    const double distance = (point_of(arm.world.arm, arm.world, pose) - anchor->second).norm();
    if (distance < kNearest || distance > kFarthest) continue;
    rows.push_back({pose, anchor->first, "distance_mm", distance + zero_mm, "", {0, 0, 0}});
    if (++anchor == arm.anchors_mm.end()) anchor = arm.anchors_mm.begin();
  }
  return rows;
}

std::vector<GaugeRow> position_rows(const GaugedArm& arm, int count, std::uint64_t seed) {
  std::vector<GaugeRow> rows;
  for (const hidden::MeasuringPose& pose : some_poses(count, seed))
    rows.push_back({pose, "", "", 0, "", point_of(arm.world.arm, arm.world, pose)});
  return rows;
}

std::string gauge_text(const std::vector<GaugeRow>& rows, double sigma_mm, std::uint64_t seed) {
  hidden::Random random(seed * 104729 + 11);
  std::string text =
      "pose_id,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,x_mm,y_mm,z_mm,distance_mm,touch_mm,"
      "anchor_id,minus_pose_id,sigma_mm\n";
  int id = 0;
  for (const GaugeRow& row : rows) {
    text += fmt::format("p{}", ++id);
    for (const double q : row.pose.q) text += fmt::format(",{:.10f}", q / kDegree);
    if (row.column.empty()) {
      for (const double x : row.p_mm)
        text += fmt::format(",{:.7f}", x + sigma_mm * hidden::normal(random));
      text += ",,,,";
    } else {
      const double value = row.value_mm + sigma_mm * hidden::normal(random);
      text += row.column == "distance_mm" ? fmt::format(",,,,{:.7f},,{}", value, row.anchor)
                                          : fmt::format(",,,,,{:.7f},{}", value, row.anchor);
      text += "," + row.minus_pose;
    }
    text += fmt::format(",{:.6g}\n", sigma_mm);
  }
  return text;
}

MeasurementBatch gauge_batch(const GaugedArm& arm, const std::vector<GaugeRow>& rows,
                             double sigma_mm, std::uint64_t seed) {
  return demand(check_against_cell(
                    demand(parse_batch_csv(gauge_text(rows, sigma_mm, seed), "gauged.csv")),
                    *arm.cell))
      .rows();
}

double volumetric_mm(const GaugedArm& arm, const CalibrationResult& found, bool in_base,
                     std::uint64_t seed) {
  const auto poses = some_poses(kAskedPoses, seed);
  Eigen::Matrix3Xd truth(3, kAskedPoses), predicted(3, kAskedPoses);
  for (Eigen::Index i = 0; i < kAskedPoses; ++i) {
    const hidden::MeasuringPose& pose = poses[static_cast<std::size_t>(i)];
    PoseContext context;
    context.q = pose.q;
    context.tool = arm.cell->tools.begin()->first;
    context.payload = arm.cell->payloads.begin()->first;
    truth.col(i) = point_of(arm.world.arm, arm.world, pose);
    predicted.col(i) = to_mm(1) * found.model.pose_W(context).translation();
  }
  if (in_base) predicted = (demand(fit_transform(truth, predicted)) * predicted).eval();
  return std::sqrt((truth - predicted).colwise().squaredNorm().mean());
}

double least_volumetric_mm(const GaugedArm& arm, const std::vector<GaugeRow>& rows, double sigma_mm,
                           bool known, bool in_base, std::uint64_t seed) {
  const auto P = static_cast<Eigen::Index>(hidden::arm_parameters().size());
  const Eigen::Index places = known ? 0 : 3 * static_cast<Eigen::Index>(arm.anchors_mm.size());
  constexpr double kAnywhere = 1000;  // mm: as uncertain as a place is before
  Eigen::MatrixXd information = Eigen::MatrixXd::Identity(P + places, P + places);
  for (const GaugeRow& row : rows) {
    const Eigen::MatrixXd columns = point_columns(arm, row.pose);
    Eigen::MatrixXd J = Eigen::MatrixXd::Zero(row.column.empty() ? 3 : 1, P + places);
    if (row.column.empty()) {
      J.leftCols(P) = columns;
    } else {
      const auto anchor = arm.anchors_mm.find(row.anchor);
      const Eigen::RowVector3d u =
          (point_of(arm.world.arm, arm.world, row.pose) - anchor->second).normalized().transpose();
      J.leftCols(P) = u * columns;
      if (!known)
        J.block<1, 3>(0, P + 3 * std::distance(arm.anchors_mm.begin(), anchor)) = -kAnywhere * u;
    }
    information += J.transpose() * J / (sigma_mm * sigma_mm);
  }
  const Eigen::MatrixXd root = Eigen::MatrixXd(information.inverse().llt().matrixL()).topRows(P);
  const auto poses = some_poses(kAskedPoses, seed);
  Eigen::MatrixXd missed(3 * kAskedPoses, P + places);
  Eigen::Matrix3Xd points(3, kAskedPoses);
  for (Eigen::Index i = 0; i < kAskedPoses; ++i) {
    const auto at = static_cast<std::size_t>(i);
    points.col(i) = point_of(arm.world.arm, arm.world, poses[at]);
    missed.middleRows<3>(3 * i) = point_columns(arm, poses[at]) * root;
  }
  if (in_base) missed = without_motion(points, missed);
  return std::sqrt(missed.squaredNorm() / kAskedPoses);
}

}  // namespace trammel::test
