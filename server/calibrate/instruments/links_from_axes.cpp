#include "server/calibrate/instruments/links_from_axes.h"

#include <algorithm>
#include <cmath>

#include "server/base/units.h"
#include "server/calibrate/instruments/axis_fit.h"

namespace trammel {

namespace {

constexpr double kParallel = 0.02;  // sine of two axes' angle, below which their common normal is nowhere

double near(double angle, double nominal) { return nominal + std::remainder(angle - nominal, 2 * kPi); }

/// The row that leads from a frame to the next axis `line`, seen in that frame.
Result<LinkGeometry> row_to(const AxisLine& line, const Joint& nominal, int joint, const std::string& robot) {
  LinkGeometry link = nominal.link;
  const Vector3& n = line.n;
  if (nominal.hayati) {
    const double side = nominal.link.a < 0 ? -1 : 1;
    const Vector3 p = line.c - n * (line.c.z() / n.z());
    link.a = side * p.head<2>().norm();
    link.theta = near(std::atan2(side * p.y(), side * p.x()), nominal.link.theta);
    const Vector3 m = Eigen::AngleAxisd(-link.theta, Vector3::UnitZ()) * n;
    link.beta = near(std::asin(std::clamp(m.x(), -1.0, 1.0)), nominal.link.beta);
    link.alpha = near(std::atan2(-m.y(), m.z()), nominal.link.alpha);
    return link;
  }
  const double sine = n.head<2>().norm();
  if (sine < kParallel) {
    return refused("robot {} link {}: axes {} and {} are parallel to {:.3f} deg", robot, joint + 1, joint + 1,
                   joint + 2, to_deg(std::asin(sine)))
        .of(fmt::format("joints {}: hayati", joint + 1))
        .next("the row must be a Hayati one");
  }
  const double side = std::sin(nominal.link.alpha) < 0 ? -1 : 1;
  link.theta = near(std::atan2(side * n.x(), -side * n.y()), nominal.link.theta);
  link.alpha = near(std::atan2(side * sine, n.z()), nominal.link.alpha);
  Matrix3 A;  // a (cos theta, sin theta, 0) + d z = c + t n
  A << std::cos(link.theta), 0, -n.x(), std::sin(link.theta), 0, -n.y(), 0, 1, -n.z();
  const Vector3 a_d_t = A.partialPivLu().solve(line.c);
  link.a = a_d_t(0);
  link.d = a_d_t(1);
  return link;
}

Pose row_pose(const LinkGeometry& link, bool hayati) {
  Pose X = Pose::Identity();
  if (!hayati) X.translate(link.d * Vector3::UnitZ());
  X.rotate(Eigen::AngleAxisd(link.theta, Vector3::UnitZ()));
  X.translate(link.a * Vector3::UnitX());
  X.rotate(Eigen::AngleAxisd(link.alpha, Vector3::UnitX()));
  if (hayati) X.rotate(Eigen::AngleAxisd(link.beta, Vector3::UnitY()));
  return X;
}

AxisLine seen_from(const Pose& X, const AxisLine& line) {
  const Pose back = X.inverse();
  return {back.linear() * line.n, back * line.c};
}

}  // namespace

std::vector<AxisLine> at_zero(const Chain& robot, const std::vector<JointArcs>& groups,
                              const std::vector<AxisLine>& measured) {
  std::vector<AxisLine> lines;
  for (int i = 0; i < robot.size(); ++i) {
    const auto at = static_cast<std::size_t>(i);
    AxisLine line = measured[at];
    line.n *= robot.joint(i).sign;
    const Eigen::VectorXd value = robot.transmission() * groups[at].posture;
    for (int j = 0; j < i; ++j) {
      const AxisLine& axis = lines[static_cast<std::size_t>(j)];
      const Matrix3 back = Eigen::AngleAxisd(-value(j), axis.n).toRotationMatrix();
      line.n = back * line.n;
      line.c = axis.c + back * (line.c - axis.c);
    }
    lines.push_back(line);
  }
  return lines;
}

Result<Links> links_of(const Chain& robot, const std::vector<AxisLine>& lines) {
  Links out;
  // Any frame on axis 1 first; then it is turned and shifted along z0 until q1 and d1 are nominal.
  Pose X = Pose::Identity();
  X.linear().col(2) = lines.front().n;
  X.linear().leftCols<2>() = across(lines.front().n);
  X.translation() = lines.front().c;
  if (robot.size() > 1) {
    const Joint& nominal = robot.joint(0);
    const LinkGeometry first = TRY(row_to(seen_from(X, lines[1]), nominal, 0, robot.name()));
    X.translate((nominal.hayati ? 0 : first.d - nominal.link.d) * Vector3::UnitZ());
    X.rotate(Eigen::AngleAxisd(first.theta - nominal.link.theta, Vector3::UnitZ()));
  }
  out.X_WB = X;
  for (int i = 0; i + 1 < robot.size(); ++i) {
    const Joint& nominal = robot.joint(i);
    const LinkGeometry link =
        TRY(row_to(seen_from(X, lines[static_cast<std::size_t>(i) + 1]), nominal, i, robot.name()));
    out.links.push_back(link);
    X = X * row_pose(link, nominal.hayati);
  }
  out.links.push_back(robot.joint(robot.size() - 1).link);
  return out;
}

}  // namespace trammel
