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

hidden::MeasuringPose contact_pose(const hidden::Arm& arm, const hidden::World& world,
                                   const Eigen::Vector3d& p_mm, hidden::Random& random) {
  constexpr double kStep = 1e-6, kLongest = 0.3;  // rad
  const auto ranges = hidden::joint_ranges("calibration");
  for (;;) {
    hidden::MeasuringPose pose;
    for (Eigen::Index j = 0; j < 6; ++j) {
      const auto& range = ranges[static_cast<std::size_t>(j)];
      pose.q(j) = hidden::uniform(random, range.first, range.second);
    }
    for (int k = 0; k < 40; ++k) {
      const Eigen::Vector3d at = point_of(arm, world, pose);
      Eigen::Matrix<double, 3, 6> J;
      for (Eigen::Index j = 0; j < 6; ++j) {
        hidden::MeasuringPose moved = pose;
        moved.q(j) += kStep;
        J.col(j) = (point_of(arm, world, moved) - at) / kStep;
      }
      const Eigen::Matrix3d square = J * J.transpose();
      const Eigen::VectorXd step = J.transpose() * square.ldlt().solve(p_mm - at);
      pose.q += step * std::min(1.0, kLongest / std::max(1e-12, step.norm()));
    }
    bool reached = (point_of(arm, world, pose) - p_mm).norm() < 1e-6;
    for (Eigen::Index j = 0; j < 6; ++j) {
      const auto& range = ranges[static_cast<std::size_t>(j)];
      reached = reached && pose.q(j) > range.first && pose.q(j) < range.second;
    }
    if (reached) return pose;
  }
}

std::vector<GaugeRow> contact_rows(const GaugedArm& arm, const std::string& id, int count,
                                   double sigma_mm, std::uint64_t seed) {
  hidden::Random random(seed * 6151 + 13);
  std::vector<GaugeRow> rows;
  while (static_cast<int>(rows.size()) < count) {
    Eigen::Vector3d met = arm.anchors_mm.at(id);
    for (double& x : met) x += sigma_mm * hidden::normal(random);
    rows.push_back(
        {contact_pose(arm.world.arm, arm.world, met, random), id, "distance_mm", 0, "", {0, 0, 0}});
  }
  return rows;
}

void add_bar(const GaugedArm& arm, double length_mm, std::uint64_t seed,
             std::vector<GaugeRow>& rows) {
  hidden::Random random(seed * 3571 + 17);
  const Eigen::Vector3d from = point_of(arm.world.arm, arm.world, rows.front().pose);
  const hidden::MeasuringPose pose =
      contact_pose(arm.world.arm, arm.world, from + length_mm * Eigen::Vector3d(0, 1, 0), random);
  const double apart = (point_of(arm.world.arm, arm.world, pose) - from).norm();
  rows.push_back({pose, "", "distance_mm", apart, "", {0, 0, 0}, "p1"});
}

std::string gauge_text(const std::vector<GaugeRow>& rows, double sigma_mm, std::uint64_t seed) {
  hidden::Random random(seed * 104729 + 11);
  std::string text =
      "pose_id,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,x_mm,y_mm,z_mm,distance_mm,touch_mm,"
      "anchor_id,minus_pose_id,from_pose_id,sigma_mm\n";
  int id = 0;
  for (const GaugeRow& row : rows) {
    text += fmt::format("p{}", ++id);
    for (const double q : row.pose.q) text += fmt::format(",{:.10f}", q / kDegree);
    if (row.column.empty()) {
      for (const double x : row.p_mm)
        text += fmt::format(",{:.7f}", x + sigma_mm * hidden::normal(random));
      text += ",,,,,";
    } else {
      const bool is_contact = row.column == "distance_mm" && row.value_mm == 0;
      const double value = is_contact ? 0 : row.value_mm + sigma_mm * hidden::normal(random);
      text += row.column == "distance_mm" ? fmt::format(",,,,{:.7f},,{}", value, row.anchor)
                                          : fmt::format(",,,,,{:.7f},{}", value, row.anchor);
      text += "," + row.minus_pose + "," + row.from_pose;
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
    const bool is_contact = row.column == "distance_mm" && row.value_mm == 0;
    const bool is_point = row.column.empty() || is_contact;
    Eigen::MatrixXd J = Eigen::MatrixXd::Zero(is_point ? 3 : 1, P + places);
    if (is_point) {
      J.leftCols(P) = columns;
      const auto anchor = arm.anchors_mm.find(row.anchor);
      if (is_contact && !known)
        J.block<3, 3>(0, P + 3 * std::distance(arm.anchors_mm.begin(), anchor)) =
            -kAnywhere * Eigen::Matrix3d::Identity();
    } else if (!row.from_pose.empty()) {
      const auto other = static_cast<std::size_t>(std::stoi(row.from_pose.substr(1)) - 1);
      const Eigen::Vector3d d = point_of(arm.world.arm, arm.world, row.pose) -
                                point_of(arm.world.arm, arm.world, rows[other].pose);
      J.leftCols(P) = d.normalized().transpose() * (columns - point_columns(arm, rows[other].pose));
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
