#include "server/calibrate/circle_point.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "server/base/text_file.h"
#include "server/base/units.h"
#include "server/measurement/csv_table.h"
#include "server/measurement/pose_columns.h"

namespace trammel {

namespace {

constexpr double kSameAngle = 1e-6;          // rad, of a joint that is held
constexpr double kAngleLimit = from_deg(1);  // turned against commanded
constexpr double kLengthDeviation = 0.1;     // m, beyond it is another robot
constexpr double kAngleDeviation = from_deg(10);
constexpr double kParallel = 0.02;   // sine of two axes' angle, below which their common normal is nowhere
constexpr double kCoverage = 2;      // k of U
constexpr double kPointLimit = 1e5;  // m

}  // namespace

Result<ArcList> parse_arcs_csv(const std::string& text, const std::string& where, const Chain& robot) {
  const Result<CsvTable> table = CsvTable::parse(text, where);
  if (!table) return tl::make_unexpected(table.error());
  const Result<PoseColumns> posture = PoseColumns::find(*table);
  if (!posture) return tl::make_unexpected(posture.error());
  const std::size_t held = posture->joint_types().size();
  if (held != 0 && held != static_cast<std::size_t>(robot.size())) {
    return refused("{}: {} posture columns, robot {} has {} joints", where, held, robot.name(), robot.size());
  }
  std::array<std::size_t, 5> columns{};
  for (std::size_t k = 0; const char* name : {"joint", "q_deg", "x_mm", "y_mm", "z_mm"}) {
    const Result<std::size_t> column = table->require(name);
    if (!column) return tl::make_unexpected(column.error());
    columns[k++] = *column;
  }
  const std::optional<std::size_t> reflector = table->find("reflector");
  ArcList arcs{where, {}};
  for (std::size_t row = 0; row < table->size(); ++row) {
    const Result<int> joint = table->integer(row, columns[0], 1, robot.size());
    if (!joint) return tl::make_unexpected(joint.error());
    ArcPoint point;
    point.joint = *joint - 1;
    point.row = table->line(row);
    point.q = JointVector::Zero(robot.size());
    if (held != 0) {
      const Result<JointVector> q = posture->joints(*table, row);
      if (!q) return tl::make_unexpected(q.error());
      point.q = *q;
    }
    const Result<double> angle = table->number(row, columns[1]);
    if (!angle) return tl::make_unexpected(angle.error());
    point.q(point.joint) = from_deg(*angle);
    for (int k = 0; k < 3; ++k) {
      const Result<double> mm = table->number(row, columns[static_cast<std::size_t>(2 + k)], to_mm(kPointLimit));
      if (!mm) return tl::make_unexpected(mm.error());
      point.p_W(k) = from_mm(*mm);
    }
    if (reflector) point.reflector = table->field(row, *reflector);
    arcs.points.push_back(std::move(point));
  }
  return arcs;
}

Result<ArcList> read_arcs_csv(const std::string& path, const Chain& robot) {
  return read_text_file(path).and_then([&](const std::string& text) { return parse_arcs_csv(text, path, robot); });
}

namespace {

/// The points of one joint, arc by arc.
struct JointArcs {
  int joint = 0;
  JointVector posture;  ///< its own value stands for nothing
  std::vector<std::vector<const ArcPoint*>> arcs;
};

/// Orthonormal u, v across `n`.
Eigen::Matrix<double, 3, 2> across(const Vector3& n) {
  Eigen::Matrix<double, 3, 2> uv;
  uv.col(0) = n.unitOrthogonal();
  uv.col(1) = n.cross(uv.col(0));
  return uv;
}

/// Circles around one line. Its small changes: two turns of n and two shifts of c along `across(n)`, then plane height
/// and radius of each arc.
struct AxisFit {
  Vector3 n, c;
  std::vector<double> height, radius;
  Eigen::MatrixXd normal_inverse;  ///< covariance of the small changes for residuals of unit variance
  double cost = 0;                 ///< sum of squared distances, m^2
  int freedom = 0;

  [[nodiscard]] Vector3 centre(std::size_t arc) const { return c + height[arc] * n; }
};

/// Refuses a robot whose joints do not all draw arcs about axes that stand still.
Status check_robot(const Chain& robot, const ArcList& arcs) {
  for (int j = 0; j < robot.size(); ++j) {
    if (robot.joint(j).type == JointType::kPrismatic) {
      return refused("robot {} joint {} slides and draws no arc; measure the arm without it", robot.name(), j + 1);
    }
    for (int before = 0; before < j; ++before) {
      if (robot.transmission()(before, j) == 0) continue;
      return refused("robot {}: joint {} follows joint {}, so that its axis moves", robot.name(), before + 1, j + 1);
    }
  }
  for (const ArcPoint& point : arcs.points) {
    if (point.q.size() == robot.size() && point.joint >= 0 && point.joint < robot.size()) continue;
    return refused("{} row {}: {} joints, robot {} has {}", arcs.where, point.row, point.q.size(), robot.name(),
                   robot.size());
  }
  return {};
}

Result<std::vector<JointArcs>> grouped(const Chain& robot, const ArcList& arcs, bool sigma_stated) {
  if (const Status fits = check_robot(robot, arcs); !fits) return tl::make_unexpected(fits.error());
  std::map<std::pair<int, std::string>, std::vector<const ArcPoint*>> by_arc;
  for (const ArcPoint& point : arcs.points) by_arc[{point.joint, point.reflector}].push_back(&point);
  std::vector<JointArcs> joints(static_cast<std::size_t>(robot.size()));
  const std::size_t least = sigma_stated ? 3 : 5;
  for (const auto& [key, points] : by_arc) {
    JointArcs& group = joints[static_cast<std::size_t>(key.first)];
    if (points.size() < least) {
      return refused("{} row {}: the arc of joint {} has {} points, at least {} are needed{}", arcs.where,
                     points.front()->row, key.first + 1, points.size(), least,
                     sigma_stated ? "" : " where sigma is not stated");
    }
    if (group.arcs.empty()) group.posture = points.front()->q;
    for (const ArcPoint* point : points) {
      for (int j = 0; j < robot.size(); ++j) {
        // Another reflector may be read with the joints beyond it elsewhere; within an arc nothing may move.
        const double from = j < key.first ? group.posture(j) : points.front()->q(j);
        if (j == key.first || std::abs(point->q(j) - from) < kSameAngle) continue;
        return refused("{} row {}: joint {} is at {:.6g} deg, held at {:.6g} deg while joint {} turns", arcs.where,
                       point->row, j + 1, to_deg(point->q(j)), to_deg(from), key.first + 1);
      }
    }
    group.arcs.push_back(points);
  }
  for (int j = 0; j < robot.size(); ++j) {
    JointArcs& group = joints[static_cast<std::size_t>(j)];
    group.joint = j;
    if (group.arcs.empty()) return refused("{}: no arc of joint {}", arcs.where, j + 1);
  }
  return joints;
}

/// Plane by the smallest singular vector of the centred points, circle in it by the linear (algebraic) form.
Result<AxisFit> rough_fit(const JointArcs& group, const std::string& where) {
  Matrix3 scatter = Matrix3::Zero();
  for (const auto& arc : group.arcs) {
    Vector3 mean = Vector3::Zero();
    for (const ArcPoint* point : arc) mean += point->p_W / static_cast<double>(arc.size());
    for (const ArcPoint* point : arc) scatter += (point->p_W - mean) * (point->p_W - mean).transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Matrix3> spread(scatter);
  const auto on_a_line = [&] {
    return refused("{} row {}: the points of joint {} lie on a line", where, group.arcs.front().front()->row,
                   group.joint + 1);
  };
  if (!(spread.eigenvalues()(1) > 1e-8 * spread.eigenvalues()(2))) return on_a_line();
  AxisFit fit;
  fit.n = spread.eigenvectors().col(0);
  const auto uv = across(fit.n);
  // |p|^2 = 2 x u + 2 y v + w: one centre, one w an arc.
  std::size_t points = 0;
  for (const auto& arc : group.arcs) points += arc.size();
  const auto arcs = static_cast<Eigen::Index>(group.arcs.size());
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(points), 2 + arcs);
  Eigen::VectorXd b(A.rows());
  const Vector3 origin = group.arcs.front().front()->p_W;
  Eigen::Index row = 0;
  for (Eigen::Index k = 0; k < arcs; ++k) {
    for (const ArcPoint* point : group.arcs[static_cast<std::size_t>(k)]) {
      const Eigen::Vector2d p = uv.transpose() * (point->p_W - origin);
      A.row(row).head<2>() = 2 * p.transpose();
      A(row, 2 + k) = 1;
      b(row++) = p.squaredNorm();
    }
  }
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(A);
  if (qr.rank() < A.cols()) return on_a_line();
  const Eigen::VectorXd solution = qr.solve(b);
  fit.c = origin + uv * solution.head<2>();
  for (Eigen::Index k = 0; k < arcs; ++k) {
    const auto& arc = group.arcs[static_cast<std::size_t>(k)];
    double height = 0;
    double radius = 0;
    for (const ArcPoint* point : arc) {
      height += fit.n.dot(point->p_W - fit.c) / static_cast<double>(arc.size());
      radius += (uv.transpose() * (point->p_W - fit.c)).norm() / static_cast<double>(arc.size());
    }
    fit.height.push_back(height);
    fit.radius.push_back(radius);
  }
  return fit;
}

struct Linearised {
  Eigen::VectorXd residual;  ///< per point: from the plane, from the circle
  Eigen::MatrixXd jacobian;  ///< by the small changes of an AxisFit
};

Linearised linearised(const AxisFit& fit, const JointArcs& group) {
  std::size_t points = 0;
  for (const auto& arc : group.arcs) points += arc.size();
  const auto arcs = static_cast<Eigen::Index>(group.arcs.size());
  Linearised out{Eigen::VectorXd(2 * static_cast<Eigen::Index>(points)),
                 Eigen::MatrixXd::Zero(2 * static_cast<Eigen::Index>(points), 4 + 2 * arcs)};
  const auto uv = across(fit.n);
  Eigen::Index row = 0;
  for (Eigen::Index k = 0; k < arcs; ++k) {
    const auto at = static_cast<std::size_t>(k);
    for (const ArcPoint* point : group.arcs[at]) {
      const Vector3 from_c = point->p_W - fit.c;
      const double along = fit.n.dot(from_c);
      const Vector3 radial = from_c - along * fit.n;
      const Vector3 outward = radial.normalized();
      out.residual(row) = along - fit.height[at];
      out.residual(row + 1) = radial.norm() - fit.radius[at];
      out.jacobian.block<1, 2>(row, 0) = radial.transpose() * uv;  // n turns by uv * t
      out.jacobian.block<1, 2>(row + 1, 0) = -along * outward.transpose() * uv;
      out.jacobian.block<1, 2>(row + 1, 2) = -outward.transpose() * uv;
      out.jacobian(row, 4 + 2 * k) = -1;
      out.jacobian(row + 1, 5 + 2 * k) = -1;
      row += 2;
    }
  }
  return out;
}

/// Gauss-Newton from the rough fit; arcs are so nearly circles that it needs a few steps.
Result<AxisFit> axis_fit(const JointArcs& group, const std::string& where) {
  Result<AxisFit> rough = rough_fit(group, where);
  if (!rough) return rough;
  AxisFit fit = *rough;
  for (int iteration = 0; iteration < 50; ++iteration) {
    const Linearised now = linearised(fit, group);
    const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(now.jacobian);
    if (qr.rank() < now.jacobian.cols()) {
      return refused("{} row {}: the arcs of joint {} do not determine its axis", where,
                     group.arcs.front().front()->row, group.joint + 1);
    }
    const Eigen::VectorXd step = qr.solve(-now.residual);
    const auto uv = across(fit.n);
    const Vector3 turn = uv * step.head<2>();
    fit.c += uv * step.segment<2>(2);
    fit.n = (fit.n + turn).normalized();
    for (std::size_t k = 0; k < group.arcs.size(); ++k) {
      fit.height[k] += step(4 + 2 * static_cast<Eigen::Index>(k));
      fit.radius[k] += step(5 + 2 * static_cast<Eigen::Index>(k));
    }
    if (step.norm() < 1e-12) break;
  }
  const Linearised last = linearised(fit, group);
  fit.cost = last.residual.squaredNorm();
  fit.freedom = static_cast<int>(last.jacobian.rows() - last.jacobian.cols());
  fit.normal_inverse = (last.jacobian.transpose() * last.jacobian)
                           .ldlt()
                           .solve(Eigen::MatrixXd::Identity(last.jacobian.cols(), last.jacobian.cols()));
  return fit;
}

/// Angles turned about the axis against angles commanded: turns `fit` so that it points in the commanded sense. Returns
/// the rms of the difference, rad.
Result<double> orient(AxisFit& fit, const JointArcs& group, const std::string& where) {
  double sum_with = 0;
  double sum_against = 0;
  double worst_with = 0;
  double worst_against = 0;
  int worst_row = 0;
  int count = 0;
  const auto uv = across(fit.n);
  for (const auto& arc : group.arcs) {
    std::vector<double> with, against;
    const Vector3 first = arc.front()->p_W - fit.c;
    for (const ArcPoint* point : arc) {
      const Eigen::Vector2d a = uv.transpose() * first;
      const Eigen::Vector2d b = uv.transpose() * (point->p_W - fit.c);
      const double turned = std::atan2(a.x() * b.y() - a.y() * b.x(), a.dot(b));
      const double commanded = point->q(group.joint) - arc.front()->q(group.joint);
      with.push_back(std::remainder(turned - commanded, 2 * kPi));
      against.push_back(std::remainder(turned + commanded, 2 * kPi));
    }
    const auto gather = [&](const std::vector<double>& values, double& sum, double& worst) {
      double mean = 0;
      for (const double value : values) mean += value / static_cast<double>(values.size());
      for (std::size_t k = 0; k < values.size(); ++k) {
        sum += (values[k] - mean) * (values[k] - mean);
        if (std::abs(values[k] - mean) > worst) {
          worst = std::abs(values[k] - mean);
          worst_row = arc[k]->row;
        }
      }
    };
    gather(against, sum_against, worst_against);
    gather(with, sum_with, worst_with);
    count += static_cast<int>(arc.size());
  }
  if (sum_against < sum_with) {
    // The columns of across(-n) differ from those of across(n): the covariance of the changes turns with them.
    AxisFit turned = fit;
    turned.n = -fit.n;
    const Eigen::Matrix2d change = across(turned.n).transpose() * uv;
    Eigen::MatrixXd basis = Eigen::MatrixXd::Identity(fit.normal_inverse.rows(), fit.normal_inverse.cols());
    basis.topLeftCorner<2, 2>() = -change;
    basis.block<2, 2>(2, 2) = change;
    for (std::size_t k = 0; k < fit.height.size(); ++k) {
      const auto row = 4 + 2 * static_cast<Eigen::Index>(k);
      turned.height[k] = -fit.height[k];
      basis(row, row) = -1;
    }
    turned.normal_inverse = basis * fit.normal_inverse * basis.transpose();
    fit = std::move(turned);
  }
  const double worst = std::min(worst_with, worst_against);
  if (worst > kAngleLimit) {
    return refused("{} row {}: joint {} turned {:.3f} deg away from its commanded angle, limit {:.0f} deg", where,
                   worst_row, group.joint + 1, to_deg(worst), to_deg(kAngleLimit));
  }
  return std::sqrt(std::min(sum_with, sum_against) / count);
}

struct Line {
  Vector3 n, c;
};

/// Lines as measured at their postures -> with the joints before them at zero, in their kinematic sense.
std::vector<Line> at_zero(const Chain& robot, const std::vector<JointArcs>& groups, const std::vector<Line>& measured) {
  std::vector<Line> lines;
  for (int i = 0; i < robot.size(); ++i) {
    const auto at = static_cast<std::size_t>(i);
    Line line = measured[at];
    line.n *= robot.joint(i).sign;
    const Eigen::VectorXd value = robot.transmission() * groups[at].posture;
    for (int j = 0; j < i; ++j) {
      const Line& axis = lines[static_cast<std::size_t>(j)];
      const Matrix3 back = Eigen::AngleAxisd(-value(j), axis.n).toRotationMatrix();
      line.n = back * line.n;
      line.c = axis.c + back * (line.c - axis.c);
    }
    lines.push_back(line);
  }
  return lines;
}

double near(double angle, double nominal) { return nominal + std::remainder(angle - nominal, 2 * kPi); }

/// The row that leads from a frame to the next axis `line`, seen in that frame.
Result<LinkGeometry> row_to(const Line& line, const Joint& nominal, int joint, const std::string& robot) {
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
    return refused("robot {} link {}: axes {} and {} are parallel to {:.3f} deg; the row must be a Hayati one", robot,
                   joint + 1, joint + 1, joint + 2, to_deg(std::asin(sine)));
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

Line seen_from(const Pose& X, const Line& line) {
  const Pose back = X.inverse();
  return {back.linear() * line.n, back * line.c};
}

struct Links {
  std::vector<LinkGeometry> links;
  Pose X_WB = Pose::Identity();
};

/// The DH procedure on axes at zero, source section 4.1.1 and Figure 4.1.
Result<Links> links_of(const Chain& robot, const std::vector<Line>& lines) {
  Links out;
  // Any frame on axis 1 first; then it is turned and shifted along z0 until q1 and d1 are nominal.
  Pose X = Pose::Identity();
  X.linear().col(2) = lines.front().n;
  X.linear().leftCols<2>() = across(lines.front().n);
  X.translation() = lines.front().c;
  if (robot.size() > 1) {
    const Joint& nominal = robot.joint(0);
    const Result<LinkGeometry> first = row_to(seen_from(X, lines[1]), nominal, 0, robot.name());
    if (!first) return tl::make_unexpected(first.error());
    X.translate((nominal.hayati ? 0 : first->d - nominal.link.d) * Vector3::UnitZ());
    X.rotate(Eigen::AngleAxisd(first->theta - nominal.link.theta, Vector3::UnitZ()));
  }
  out.X_WB = X;
  for (int i = 0; i + 1 < robot.size(); ++i) {
    const Joint& nominal = robot.joint(i);
    const Result<LinkGeometry> link =
        row_to(seen_from(X, lines[static_cast<std::size_t>(i) + 1]), nominal, i, robot.name());
    if (!link) return tl::make_unexpected(link.error());
    out.links.push_back(*link);
    X = X * row_pose(*link, nominal.hayati);
  }
  out.links.push_back(robot.joint(robot.size() - 1).link);
  return out;
}

struct NamedMember {
  int joint;
  double LinkGeometry::*member;
  const char* symbol;
  bool length;
};

std::vector<NamedMember> members_of(const Chain& robot) {
  std::vector<NamedMember> members;
  for (int i = 0; i < robot.size(); ++i) {
    members.push_back({i, &LinkGeometry::theta, "q", false});
    if (!robot.joint(i).hayati) members.push_back({i, &LinkGeometry::d, "d", true});
    members.push_back({i, &LinkGeometry::a, "a", true});
    members.push_back({i, &LinkGeometry::alpha, "alpha", false});
    if (robot.joint(i).hayati) members.push_back({i, &LinkGeometry::beta, "beta", false});
  }
  return members;
}

std::string why_not_measured(const NamedMember& member, const Chain& robot) {
  if (member.joint == robot.size() - 1) return "the last link: nothing marks the flange";
  if (member.joint != 0) return {};
  if (member.member == &LinkGeometry::theta) return "nothing marks the base's azimuth: x0 is conventional";
  if (member.member == &LinkGeometry::d) return "nothing marks the base's height: the origin on axis 1 is conventional";
  return {};
}

Eigen::VectorXd deviations(const Chain& robot, const std::vector<NamedMember>& members,
                           const std::vector<LinkGeometry>& links) {
  Eigen::VectorXd values(static_cast<Eigen::Index>(members.size()));
  for (std::size_t k = 0; k < members.size(); ++k) {
    const auto link = static_cast<std::size_t>(members[k].joint);
    values(static_cast<Eigen::Index>(k)) =
        links[link].*members[k].member - robot.joint(members[k].joint).link.*members[k].member;
  }
  return values;
}

/// Everything measured at its posture, with the variance of each joint's residuals.
struct Fits {
  std::vector<AxisFit> axes;
  std::vector<double> variance;  ///< m^2, of one coordinate
  std::vector<double> widening;  ///< of a covariance whose variance was itself estimated
};

std::vector<Line> lines_of(const Fits& fits) {
  std::vector<Line> lines;
  for (const AxisFit& fit : fits.axes) lines.push_back({fit.n, fit.c});
  return lines;
}

/// Covariance of the deviations: first derivatives by central differences, a step of one standard deviation each way.
Result<Eigen::MatrixXd> propagated(const Chain& robot, const std::vector<JointArcs>& groups, const Fits& fits,
                                   const std::vector<NamedMember>& members) {
  const auto size = static_cast<Eigen::Index>(members.size());
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(size, size);
  for (std::size_t i = 0; i < fits.axes.size(); ++i) {
    const AxisFit& fit = fits.axes[i];
    const Eigen::Matrix4d small = fit.normal_inverse.topLeftCorner<4, 4>() * (fits.variance[i] * fits.widening[i]);
    const auto uv = across(fit.n);
    Eigen::MatrixXd J(size, 4);
    for (int k = 0; k < 4; ++k) {
      const double step = std::max(std::sqrt(small(k, k)), 1e-9);
      Eigen::VectorXd sides[2];
      for (const int side : {0, 1}) {
        std::vector<Line> lines = lines_of(fits);
        const Vector3 move = uv.col(k % 2) * (side == 0 ? -step : step);
        if (k < 2) {
          lines[i].n = (fit.n + move).normalized();
        } else {
          lines[i].c += move;
        }
        const Result<Links> links = links_of(robot, at_zero(robot, groups, lines));
        if (!links) return tl::make_unexpected(links.error());
        sides[side] = deviations(robot, members, links->links);
      }
      J.col(k) = (sides[1] - sides[0]) / (2 * step);
    }
    covariance += J * small * J.transpose();
  }
  return covariance;
}

/// Worst direction's U(k=2) of a symmetric covariance.
double worst_u(const Eigen::MatrixXd& covariance) {
  return kCoverage *
         std::sqrt(std::max(0.0, Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(covariance).eigenvalues().maxCoeff()));
}

void describe_circles(const JointArcs& group, const AxisFit& fit, double variance, std::vector<CircleFit>& circles) {
  const Linearised last = linearised(fit, group);
  const auto uv = across(fit.n);
  Eigen::Index row = 0;
  for (std::size_t k = 0; k < group.arcs.size(); ++k) {
    const auto& arc = group.arcs[k];
    CircleFit circle;
    circle.joint = group.joint;
    circle.reflector = arc.front()->reflector;
    circle.points = static_cast<int>(arc.size());
    circle.centre_W = fit.centre(k);
    circle.radius = fit.radius[k];
    const auto by_angle = [&](const ArcPoint* a, const ArcPoint* b) { return a->q(group.joint) < b->q(group.joint); };
    const auto [low, high] = std::minmax_element(arc.begin(), arc.end(), by_angle);
    circle.span = (*high)->q(group.joint) - (*low)->q(group.joint);
    for (std::size_t p = 0; p < arc.size(); ++p, row += 2) {
      circle.plane_rms += last.residual(row) * last.residual(row);
      circle.circle_rms += last.residual(row + 1) * last.residual(row + 1);
    }
    circle.plane_rms = std::sqrt(circle.plane_rms / circle.points);
    circle.circle_rms = std::sqrt(circle.circle_rms / circle.points);
    Eigen::MatrixXd to_centre = Eigen::MatrixXd::Zero(3, fit.normal_inverse.cols());  // c + height n
    to_centre.leftCols<2>() = fit.height[k] * uv;
    to_centre.middleCols<2>(2) = uv;
    to_centre.col(4 + 2 * static_cast<Eigen::Index>(k)) = fit.n;
    circle.centre_u = worst_u(variance * to_centre * fit.normal_inverse * to_centre.transpose());
    circles.push_back(circle);
  }
}

/// The same robot with other links.
Result<Chain> with_links(const Chain& robot, const std::vector<LinkGeometry>& links) {
  std::vector<Joint> joints;
  std::vector<Coupling> couplings;
  for (int i = 0; i < robot.size(); ++i) {
    Joint joint = robot.joint(i);
    joint.link = links[static_cast<std::size_t>(i)];
    joints.push_back(joint);
    for (int j = 0; j < robot.size(); ++j) {
      if (i != j && robot.transmission()(i, j) != 0) couplings.push_back({i, j, robot.transmission()(i, j)});
    }
  }
  return Chain::make(robot.name(), std::move(joints), std::move(couplings));
}

}  // namespace

Result<CirclePointResult> analyse_circle_points(const Chain& robot, const ArcList& arcs,
                                                const CirclePointOptions& options) {
  const Result<std::vector<JointArcs>> groups = grouped(robot, arcs, options.sigma.has_value());
  if (!groups) return tl::make_unexpected(groups.error());
  CirclePointResult result;
  Fits fits;
  for (const JointArcs& group : *groups) {
    Result<AxisFit> fit = axis_fit(group, arcs.where);
    if (!fit) return tl::make_unexpected(fit.error());
    const Result<double> angle_rms = orient(*fit, group, arcs.where);
    if (!angle_rms) return tl::make_unexpected(angle_rms.error());
    const double seen = fit->freedom > 0 ? fit->cost / fit->freedom : 0;
    const double stated = options.sigma.value_or(0) * options.sigma.value_or(0);
    fits.variance.push_back(std::max(seen, stated));
    // Student's t with f degrees of freedom has the variance f / (f - 2).
    const bool estimated = seen > stated && fit->freedom > 2;
    fits.widening.push_back(estimated ? fit->freedom / (fit->freedom - 2.0) : 1);
    const double variance = fits.variance.back() * fits.widening.back();
    JointAxis axis;
    axis.sigma = std::sqrt(fits.variance.back());
    axis.freedom = fit->freedom;
    axis.angle_rms = *angle_rms;
    axis.direction_u = worst_u(variance * fit->normal_inverse.topLeftCorner<2, 2>());
    result.axes.push_back(axis);
    describe_circles(group, *fit, variance, result.circles);
    fits.axes.push_back(std::move(*fit));
  }
  const std::vector<Line> lines = at_zero(robot, *groups, lines_of(fits));
  for (std::size_t i = 0; i < lines.size(); ++i) {
    result.axes[i].direction_W = lines[i].n;
    result.axes[i].point_W = lines[i].c;
  }
  const Result<Links> links = links_of(robot, lines);
  if (!links) return tl::make_unexpected(links.error());
  const std::vector<NamedMember> members = members_of(robot);
  const Eigen::VectorXd deviation = deviations(robot, members, links->links);
  const Result<Eigen::MatrixXd> covariance = propagated(robot, *groups, fits, members);
  if (!covariance) return tl::make_unexpected(covariance.error());
  for (std::size_t k = 0; k < members.size(); ++k) {
    const NamedMember& member = members[k];
    const auto at = static_cast<Eigen::Index>(k);
    MeasuredParameter parameter;
    parameter.name = fmt::format("{}{}", member.symbol, member.joint + 1);
    parameter.length = member.length;
    parameter.nominal = robot.joint(member.joint).link.*member.member;
    parameter.note = why_not_measured(member, robot);
    parameter.measured = parameter.note.empty();
    if (parameter.measured) {
      parameter.deviation = deviation(at);
      parameter.u = kCoverage * std::sqrt(std::max(0.0, (*covariance)(at, at)));
      const double limit = member.length ? kLengthDeviation : kAngleDeviation;
      if (!(std::abs(deviation(at)) < limit)) {
        return refused("{}: {} is {:.3f} {} from that of robot {}, limit {:.0f}; another robot, joint or posture?",
                       arcs.where, parameter.name, member.length ? to_mm(deviation(at)) : to_deg(deviation(at)),
                       member.length ? "mm" : "deg", robot.name(), member.length ? to_mm(limit) : to_deg(limit));
      }
    }
    result.parameters.push_back(std::move(parameter));
  }
  result.covariance = *covariance;
  result.X_WB = links->X_WB;
  Result<Chain> measured = with_links(robot, links->links);
  if (!measured) return tl::make_unexpected(measured.error());
  result.robot = std::move(*measured);
  return result;
}

}  // namespace trammel
