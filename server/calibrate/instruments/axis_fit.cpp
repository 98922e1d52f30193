#include "server/calibrate/instruments/axis_fit.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "server/base/units.h"

namespace trammel {

namespace {

constexpr double kMostAngleOff =
    from_deg(1);  // between turned and commanded angle: ten times the errors of an arm's gears
constexpr double kLine =
    1e-8;  // ratio of variances across and along: below it points are on a line
constexpr int kMostSteps = 50;       // arcs are so nearly circles that a few are enough
constexpr double kLastStep = 1e-12;  // m, rad: rounding

/// Plane by the smallest singular vector of the centred points, circle in it by the linear
/// (algebraic) form.
std::size_t points_of(const JointArcs& group) {
  std::size_t points = 0;
  for (const auto& arc : group.arcs) points += arc.size();
  return points;
}

/// Second moments of the points about the means of their arcs.
Matrix3 scatter_of(const JointArcs& group) {
  Matrix3 scatter = Matrix3::Zero();
  for (const auto& arc : group.arcs) {
    Vector3 mean = Vector3::Zero();
    for (const ArcPoint* point : arc) mean += point->p_W / static_cast<double>(arc.size());
    for (const ArcPoint* point : arc)
      scatter += (point->p_W - mean) * (point->p_W - mean).transpose();
  }
  return scatter;
}

/// The common centre across the axis. It solves |p|^2 = 2 x u + 2 y v + w with one centre (u, v)
/// and one w per arc. Empty if the points do not determine it.
std::optional<Vector3> rough_centre(const JointArcs& group, const Eigen::Matrix<double, 3, 2>& uv) {
  const auto arcs = static_cast<Eigen::Index>(group.arcs.size());
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(points_of(group)), 2 + arcs);
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
  if (qr.rank() < A.cols()) return std::nullopt;
  const Eigen::VectorXd solution = qr.solve(b);
  return origin + uv * solution.head<2>();
}

/// Plane by the smallest singular vector of the centred points, circle in it by the linear
/// (algebraic) form.
Result<AxisFit> rough_fit(const JointArcs& group, const std::string& where) {
  const Eigen::SelfAdjointEigenSolver<Matrix3> spread(scatter_of(group));
  AxisFit fit;
  fit.n = spread.eigenvectors().col(0);
  const auto uv = across(fit.n);
  const bool on_a_line = !(spread.eigenvalues()(1) > kLine * spread.eigenvalues()(2));
  const std::optional<Vector3> centre = on_a_line ? std::nullopt : rough_centre(group, uv);
  if (!centre) {
    return refused("the points of joint {} lie on a line", group.joint + 1)
        .in(where)
        .at_row(group.arcs.front().front()->row)
        .of("joint")
        .with_value(group.joint + 1);
  }
  fit.c = *centre;
  for (const auto& arc : group.arcs) {
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

}  // namespace

Eigen::Matrix<double, 3, 2> across(const Vector3& n) {
  Eigen::Matrix<double, 3, 2> uv;
  uv.col(0) = n.unitOrthogonal();
  uv.col(1) = n.cross(uv.col(0));
  return uv;
}

Linearised linearised(const AxisFit& fit, const JointArcs& group) {
  const auto points = static_cast<Eigen::Index>(points_of(group));
  const auto arcs = static_cast<Eigen::Index>(group.arcs.size());
  Linearised out{Eigen::VectorXd(2 * points), Eigen::MatrixXd::Zero(2 * points, 4 + 2 * arcs)};
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

namespace {

/// The small changes of linearised() carried out.
void change(AxisFit& fit, const Eigen::VectorXd& step) {
  const auto uv = across(fit.n);
  const Vector3 turn = uv * step.head<2>();
  fit.c += uv * step.segment<2>(2);
  fit.n = (fit.n + turn).normalized();
  for (std::size_t k = 0; k < fit.height.size(); ++k) {
    fit.height[k] += step(4 + 2 * static_cast<Eigen::Index>(k));
    fit.radius[k] += step(5 + 2 * static_cast<Eigen::Index>(k));
  }
}

}  // namespace

Result<AxisFit> axis_fit(const JointArcs& group, const std::string& where) {
  Result<AxisFit> rough = rough_fit(group, where);
  if (!rough) return rough;
  AxisFit fit = *rough;
  for (int iteration = 0; iteration < kMostSteps; ++iteration) {  // Gauss-Newton
    const Linearised now = linearised(fit, group);
    const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(now.jacobian);
    if (qr.rank() < now.jacobian.cols()) {
      return refused("the arcs of joint {} do not determine its axis", group.joint + 1)
          .in(where)
          .at_row(group.arcs.front().front()->row)
          .of("joint")
          .with_value(group.joint + 1);
    }
    const Eigen::VectorXd step = qr.solve(-now.residual);
    change(fit, step);
    if (step.norm() < kLastStep) break;
  }
  const Linearised last = linearised(fit, group);
  fit.cost = last.residual.squaredNorm();
  fit.freedom = static_cast<int>(last.jacobian.rows() - last.jacobian.cols());
  fit.normal_inverse =
      (last.jacobian.transpose() * last.jacobian)
          .ldlt()
          .solve(Eigen::MatrixXd::Identity(last.jacobian.cols(), last.jacobian.cols()));
  return fit;
}

namespace {

/// Angles turned against angles commanded, in one sense of turning; the mean difference of each arc
/// is left out.
struct Disagreement {
  double sum = 0;    // of squares, rad²
  double worst = 0;  // rad
  int worst_row = 0;
  int count = 0;

  void add(const std::vector<double>& differences, const std::vector<const ArcPoint*>& arc) {
    double mean = 0;
    for (const double value : differences) mean += value / static_cast<double>(differences.size());
    for (std::size_t k = 0; k < differences.size(); ++k) {
      const double off = differences[k] - mean;
      sum += off * off;
      if (std::abs(off) > worst) worst = std::abs(off), worst_row = arc[k]->row;
    }
    count += static_cast<int>(differences.size());
  }
};

/// With `sense` 1 the joint turns about the axis as commanded, with -1 against it.
Disagreement disagreement(const AxisFit& fit, const JointArcs& group, int sense) {
  Disagreement found;
  const auto uv = across(fit.n);
  for (const auto& arc : group.arcs) {
    std::vector<double> differences;
    const Vector3 first = arc.front()->p_W - fit.c;
    for (const ArcPoint* point : arc) {
      const Eigen::Vector2d a = uv.transpose() * first;
      const Eigen::Vector2d b = uv.transpose() * (point->p_W - fit.c);
      const double turned = std::atan2(a.x() * b.y() - a.y() * b.x(), a.dot(b));
      const double commanded = point->q(group.joint) - arc.front()->q(group.joint);
      differences.push_back(std::remainder(turned - sense * commanded, 2 * kPi));
    }
    found.add(differences, arc);
  }
  return found;
}

/// The fit of the same circles about the opposite direction.
AxisFit reversed(const AxisFit& fit) {
  AxisFit turned = fit;
  turned.n = -fit.n;
  // The columns of across(-n) differ from those of across(n), so the covariance of the changes
  // turns with them.
  const Eigen::Matrix2d change = across(turned.n).transpose() * across(fit.n);
  Eigen::MatrixXd basis =
      Eigen::MatrixXd::Identity(fit.normal_inverse.rows(), fit.normal_inverse.cols());
  basis.topLeftCorner<2, 2>() = -change;
  basis.block<2, 2>(2, 2) = change;
  for (std::size_t k = 0; k < fit.height.size(); ++k) {
    const auto row = 4 + 2 * static_cast<Eigen::Index>(k);
    turned.height[k] = -fit.height[k];
    basis(row, row) = -1;
  }
  turned.normal_inverse = basis * fit.normal_inverse * basis.transpose();
  return turned;
}

}  // namespace

Result<double> orient(AxisFit& fit, const JointArcs& group, const std::string& where) {
  const Disagreement with = disagreement(fit, group, 1);
  const Disagreement against = disagreement(fit, group, -1);
  if (against.sum < with.sum) fit = reversed(fit);
  const Disagreement& least = against.worst < with.worst ? against : with;
  if (least.worst > kMostAngleOff) {
    return refused("joint {} turned {:.3f} deg away from its commanded angle, limit {:.0f} deg",
                   group.joint + 1, to_deg(least.worst), to_deg(kMostAngleOff))
        .in(where)
        .at_row(least.worst_row)
        .of("q_deg")
        .beyond(to_deg(least.worst), to_deg(kMostAngleOff));
  }
  return std::sqrt(std::min(with.sum, against.sum) / with.count);
}

}  // namespace trammel
