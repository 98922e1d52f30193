#include "server/calibrate/instruments/axis_fit.h"

#include <algorithm>
#include <cmath>

#include "server/base/units.h"

namespace trammel {

namespace {

constexpr double kAngleLimit = from_deg(1);  // turned against commanded

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
    return refused("the points of joint {} lie on a line", group.joint + 1)
        .in(where)
        .at_row(group.arcs.front().front()->row)
        .of("joint")
        .with_value(group.joint + 1);
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

}  // namespace

Eigen::Matrix<double, 3, 2> across(const Vector3& n) {
  Eigen::Matrix<double, 3, 2> uv;
  uv.col(0) = n.unitOrthogonal();
  uv.col(1) = n.cross(uv.col(0));
  return uv;
}

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

Result<AxisFit> axis_fit(const JointArcs& group, const std::string& where) {
  // Gauss-Newton; arcs are so nearly circles that it needs a few steps.
  Result<AxisFit> rough = rough_fit(group, where);
  if (!rough) return rough;
  AxisFit fit = *rough;
  for (int iteration = 0; iteration < 50; ++iteration) {
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
    return refused("joint {} turned {:.3f} deg away from its commanded angle, limit {:.0f} deg", group.joint + 1,
                   to_deg(worst), to_deg(kAngleLimit))
        .in(where)
        .at_row(worst_row)
        .of("q_deg")
        .beyond(to_deg(worst), to_deg(kAngleLimit));
  }
  return std::sqrt(std::min(sum_with, sum_against) / count);
}

}  // namespace trammel
