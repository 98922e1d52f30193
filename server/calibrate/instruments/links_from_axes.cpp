#include "server/calibrate/instruments/links_from_axes.h"

#include <algorithm>
#include <cmath>

#include "server/base/units.h"
#include "server/calibrate/instruments/axis_fit.h"

namespace trammel {

namespace {

constexpr double kAsDrawn =
    1e-6;  // sine, and m: a row that is drawn with parallel axes, or on the next axis
constexpr double kParallel =
    0.02;  // sine of two axes' angle, below which their common normal is nowhere

double near(double angle, double nominal) {
  return nominal + std::remainder(angle - nominal, 2 * kPi);
}

/// The row that leads from a frame to the next axis `line`, which is given in that frame.
Result<LinkGeometry> row_to(const AxisLine& line, const Joint& nominal, int joint,
                            const std::string& robot) {
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
    return refused("robot {} link {}: axes {} and {} are parallel to {:.3f} deg", robot, joint + 1,
                   joint + 1, joint + 2, to_deg(std::asin(sine)))
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

bool slides(const Chain& robot, int joint) {
  return robot.joint(joint).type == JointType::kPrismatic;
}

Result<TurningJoints> turning_joints(const Chain& robot) {
  TurningJoints turning{robot.size(), -1};
  for (int j = 0; j < robot.size(); ++j) {
    if (slides(robot, j)) continue;
    turning.first = std::min(turning.first, j);
    turning.last = j;
  }
  if (turning.last < 0) return refused("no joint of robot {} turns", robot.name()).of("joints");
  for (int j = turning.first; j < turning.last; ++j) {
    const LinkGeometry& link = robot.joint(j).link;
    const bool along = std::abs(std::sin(link.alpha)) < kAsDrawn && std::abs(link.a) < kAsDrawn;
    if (!slides(robot, j) || (along && !slides(robot, j + 1))) continue;
    return refused(
               "robot {} joint {} slides, and not along the axis of joint {}: arcs do not tell how "
               "it leads there",
               robot.name(), j + 1, j + 2)
        .of(fmt::format("joint {}", j + 1))
        .next("measure poses, and train with the error source geometry");
  }
  return turning;
}

Result<Chain> with_hayati_rows(const Chain& robot, const TurningJoints& turning,
                               std::vector<Note>& notes) {
  std::vector<Joint> joints;
  double carried = 0;  // m, along the axis
  for (int j = 0; j < robot.size(); ++j) {
    Joint joint = robot.joint(j);
    const double cosine = std::cos(joint.link.alpha);
    const bool is_parallel =
        joint.type == JointType::kRevolute && std::abs(std::sin(joint.link.alpha)) < kAsDrawn;
    const bool becomes = is_parallel && !joint.hayati && j >= turning.first && j < turning.last;
    if (becomes) {
      notes.push_back({"hayati_row", Note::Severity::kInfo,
                       fmt::format("the axes of joint {} and the next one are parallel, and row {} "
                                   "is no Hayati row: it is told as one (`hayati: true`: a, alpha "
                                   "and beta, no d; what it has as d stands in the row behind it)",
                                   j + 1, j + 1)});
    }
    if (becomes || (joint.hayati && carried != 0)) {
      carried = cosine * (carried + joint.link.d);
      joint.link.d = 0;
      joint.hayati = true;
    } else {
      joint.link.d += carried;
      carried = 0;
    }
    joints.push_back(joint);
  }
  return Chain::make(robot.name(), std::move(joints), robot.couplings());
}

std::vector<AxisLine> at_zero(const Chain& robot, const std::vector<JointArcs>& groups,
                              const std::vector<AxisLine>& measured) {
  std::vector<AxisLine> lines;
  for (int i = 0; i < robot.size(); ++i) {
    const auto at = static_cast<std::size_t>(i);
    AxisLine line = measured[at];
    if (slides(robot, i)) {
      lines.push_back(line);
      continue;
    }
    line.n *= robot.joint(i).sign;
    const Eigen::VectorXd value = robot.transmission() * groups[at].posture;
    for (int j = 0; j < i; ++j) {
      if (slides(robot, j)) continue;
      const AxisLine& axis = lines[static_cast<std::size_t>(j)];
      const Matrix3 back = Eigen::AngleAxisd(-value(j), axis.n).toRotationMatrix();
      line.n = back * line.n;
      line.c = axis.c + back * (line.c - axis.c);
    }
    lines.push_back(line);
  }
  for (int i = 0; i + 1 < robot.size(); ++i) {
    if (!slides(robot, i)) continue;
    const AxisLine& next = lines[static_cast<std::size_t>(i) + 1];
    lines[static_cast<std::size_t>(i)] = {std::cos(robot.joint(i).link.alpha) * next.n, next.c};
  }
  return lines;
}

Result<Links> links_of(const Chain& robot, const std::vector<AxisLine>& lines,
                       const JointVector& held) {
  const TurningJoints turning = TRY(turning_joints(robot));
  const auto first = static_cast<std::size_t>(turning.first);
  Links out;
  // Any frame on the first axis; then it is turned and shifted along it until q and d of the first
  // row are nominal.
  Pose X = Pose::Identity();
  X.linear().col(2) = lines[first].n;
  X.linear().leftCols<2>() = across(lines[first].n);
  X.translation() = lines[first].c;
  if (turning.last > turning.first) {
    const Joint& nominal = robot.joint(turning.first);
    const LinkGeometry row =
        TRY(row_to(seen_from(X, lines[first + 1]), nominal, turning.first, robot.name()));
    X.translate((nominal.hayati ? 0 : row.d - nominal.link.d) * Vector3::UnitZ());
    X.rotate(Eigen::AngleAxisd(row.theta - nominal.link.theta, Vector3::UnitZ()));
  }
  const std::vector<LinkGeometry> as_held = robot.links_at(held);
  Pose before = Pose::Identity();  // of the first turning joint
  for (std::size_t i = 0; i < first; ++i)
    before = before * row_pose(as_held[i], robot.joint(static_cast<int>(i)).hayati);
  out.X_WB = X * before.inverse();
  for (int i = 0; i < robot.size(); ++i) {
    const Joint& nominal = robot.joint(i);
    const bool is_measured = i >= turning.first && i < turning.last && !slides(robot, i);
    if (!is_measured) {
      out.links.push_back(nominal.link);
      if (i >= turning.first)
        X = X * row_pose(as_held[static_cast<std::size_t>(i)], nominal.hayati);
      continue;
    }
    out.links.push_back(TRY(
        row_to(seen_from(X, lines[static_cast<std::size_t>(i) + 1]), nominal, i, robot.name())));
    X = X * row_pose(out.links.back(), nominal.hayati);
  }
  return out;
}

}  // namespace trammel
