#include "server/measurement/spread_check.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <vector>

#include "server/base/median.h"
#include "server/base/units.h"
#include "server/measurement/reading_units.h"

namespace trammel {

namespace {

constexpr double kRatio = 3;     // nominal and real robot differ by millimetres, not by this factor
constexpr double kSlack = 0.05;  // m: the possible effect of a wrong tool or a moved tracker in a
                                 // small batch
constexpr double kSlackOfSmallAngles =
    0.01;  // m: with |q| within 2 pi degrees the tool's share is a tenth
constexpr double kUnknownToolLength = 0.5;  // m

/// The smallest and largest possible spread of the nominal tool points, m.
struct NominalSpread {
  double smallest = 0;
  double largest = 0;
};

double spread_of(const std::vector<Vector3>& points) {
  Vector3 centroid = Vector3::Zero();
  for (const Vector3& p : points) centroid += p / static_cast<double>(points.size());
  double sum = 0;
  for (const Vector3& p : points) sum += (p - centroid).squaredNorm();
  return std::sqrt(sum / static_cast<double>(points.size()));
}

/// The spread of the nine tenths of the points that are nearest to the middle. An instrument that
/// saw nothing may write a number such as -9999. That is a bad row and not another unit.
double spread_of_most(std::vector<Vector3> points) {
  constexpr double kMost = 0.9;
  Vector3 middle;
  for (int k = 0; k < 3; ++k) {
    std::vector<double> values;
    for (const Vector3& p : points) values.push_back(p(k));
    middle(k) = median(std::move(values));
  }
  std::sort(points.begin(), points.end(), [&](const Vector3& a, const Vector3& b) {
    return (a - middle).squaredNorm() < (b - middle).squaredNorm();
  });
  points.resize(static_cast<std::size_t>(std::ceil(kMost * static_cast<double>(points.size()))));
  return spread_of(points);
}

/// With the tool point t in F unknown, the squared spread is c + 2 bᵀt + tᵀAt; its least and
/// greatest value for |t| <= kUnknownToolLength, the least found along the way to the unbounded
/// minimum.
NominalSpread spread_with_unknown_tool(const std::vector<Pose>& flanges) {
  const auto n = static_cast<double>(flanges.size());
  Vector3 p_mean = Vector3::Zero();
  Matrix3 R_mean = Matrix3::Zero();
  for (const Pose& X_BF : flanges) {
    p_mean += X_BF.translation() / n;
    R_mean += X_BF.linear() / n;
  }
  double c = 0;
  Vector3 b = Vector3::Zero();
  Matrix3 A = Matrix3::Zero();
  for (const Pose& X_BF : flanges) {
    const Vector3 p = X_BF.translation() - p_mean;
    const Matrix3 R = X_BF.linear() - R_mean;
    c += p.squaredNorm() / n;
    b += R.transpose() * p / n;
    A += R.transpose() * R / n;
  }
  const Eigen::SelfAdjointEigenSolver<Matrix3> eigen(A);
  Vector3 t = Vector3::Zero();
  for (int k = 0; k < 3; ++k) {
    const Vector3 axis = eigen.eigenvectors().col(k);
    if (eigen.eigenvalues()(k) > 1e-12) t -= axis * (axis.dot(b) / eigen.eigenvalues()(k));
  }
  if (t.norm() > kUnknownToolLength) t *= kUnknownToolLength / t.norm();
  const double least = c + 2 * b.dot(t) + t.dot(A * t);
  return {std::sqrt(std::max(0.0, least)),
          std::sqrt(c) + kUnknownToolLength * std::sqrt(std::max(0.0, eigen.eigenvalues()(2)))};
}

NominalSpread nominal_spread(const std::vector<Pose>& flanges, const std::optional<Pose>& X_FT) {
  if (!X_FT) return spread_with_unknown_tool(flanges);
  std::vector<Vector3> points;
  for (const Pose& X_BF : flanges) points.push_back(X_BF * X_FT->translation());  // p_BT
  const double spread = spread_of(points);
  return {spread, spread};
}

/// The measurements with one tool.
struct ToolGroup {
  std::vector<Pose> flanges;  // X_BF
  std::vector<Vector3> measured_W;
  double largest_angle_deg = 0;
};

std::map<std::string, ToolGroup> group_by_tool(const MeasurementBatch& batch, const Chain& robot) {
  std::map<std::string, ToolGroup> groups;
  for (const Measurement& m : batch.measurements) {
    ToolGroup& group = groups[m.context.tool];
    group.flanges.push_back(robot.flange_pose(m.context.q));
    group.measured_W.push_back(m.p_W);
    for (int j = 0; j < robot.size(); ++j) {
      if (robot.joint(j).type != JointType::kRevolute) continue;
      group.largest_angle_deg = std::max(group.largest_angle_deg, std::abs(to_deg(m.context.q(j))));
    }
  }
  return groups;
}

}  // namespace

Status check_spread(const MeasurementBatch& batch, const Cell& cell, const std::string& where) {
  for (const auto& [tool, group] : group_by_tool(batch, cell.robot)) {
    const NominalSpread nominal = nominal_spread(group.flanges, cell.tools.at(tool));
    const double measured = spread_of(group.measured_W);
    const bool small_angles = group.largest_angle_deg <= kMostRadians;
    const double most = spread_of_most(group.measured_W);
    const double upper = kRatio * nominal.largest + (small_angles ? kSlackOfSmallAngles : kSlack);
    if (most > upper && small_angles) {
      return refused(
                 "measured positions spread over {:.1f} mm (rms from their centroid), but the "
                 "commanded joints, all within {:.2f} deg, move the tool over {:.1f} mm at most",
                 to_mm(measured), group.largest_angle_deg, to_mm(nominal.largest))
          .in(where)
          .of("q1_deg")
          .beyond(to_mm(measured), to_mm(upper))
          .next("are the joints radians? They must be degrees");
    }
    if (most > upper || kRatio * measured + kSlack < nominal.smallest) {
      return refused(
                 "measured positions spread over {:.1f} mm (rms from their centroid), the "
                 "commanded joints move tool '{}' over {:.1f} mm, limit: a factor of {:g} and {:g} "
                 "mm",
                 to_mm(measured), tool,
                 to_mm(measured > upper ? nominal.largest : nominal.smallest), kRatio,
                 to_mm(kSlack))
          .in(where)
          .of("x_mm")
          .beyond(to_mm(measured),
                  to_mm(measured > upper ? upper : (nominal.smallest - kSlack) / kRatio))
          .next("Are positions mm, joints degrees, and is this the robot?");
    }
  }
  return {};
}

}  // namespace trammel
