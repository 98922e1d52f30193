#pragma once

#include <Eigen/Dense>
#include <string>
#include <vector>

#include "server/calibrate/instruments/arc_list.h"

/// The axis that a joint's arcs are drawn about, as the tracker sees it.
namespace trammel {

/// Orthonormal u, v across the unit vector `n`.
[[nodiscard]] Eigen::Matrix<double, 3, 2> across(const Vector3& n);

/// Circles around one line. Its small changes: two turns of n and two shifts of c along
/// `across(n)`, then plane height and radius of each arc.
struct AxisFit {
  Vector3 n, c;                        ///< W: direction, and a point on the line, m
  std::vector<double> height, radius;  ///< m, an arc each
  Eigen::MatrixXd
      normal_inverse;  ///< covariance of the small changes for residuals of unit variance
  double cost = 0;     ///< sum of squared distances, m^2
  int freedom = 0;

  [[nodiscard]] Vector3 centre(std::size_t arc) const { return c + height[arc] * n; }
};

/// The residual of an axis, m, and its derivative.
struct Linearised {
  Eigen::VectorXd residual;  ///< per point: from the plane, from the circle
  Eigen::MatrixXd jacobian;  ///< by the small changes of an AxisFit
};

[[nodiscard]] Linearised linearised(const AxisFit& fit, const JointArcs& group);

/// Least squares on the distances of all points from their planes and circles, with normal, axis
/// and radii together. Refuses points on a line, and arcs that do not determine an axis; `where`
/// names the file.
[[nodiscard]] Result<AxisFit> axis_fit(const JointArcs& group, const std::string& where);

/// Angles turned about the axis against angles commanded: turns `fit` so that it points in the
/// commanded sense. Returns the rms of the difference, rad. Refuses a difference of more than 1
/// degree.
[[nodiscard]] Result<double> orient(AxisFit& fit, const JointArcs& group, const std::string& where);

}  // namespace trammel
