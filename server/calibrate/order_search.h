#pragma once

#include <Eigen/Dense>

#include "server/error_sources/error_source.h"

namespace trammel {

/// A sine and a cosine of one order, fitted to a joint's share of the residuals.
struct FoundOrder {
  double order = 0;             ///< cycles a turn of the joint
  double sine = 0, cosine = 0;  ///< rad
  double gain = 0;              ///< weighted sum of squares explained
};

/// Periodogram in joint space with unequal weights: over `search`, then refined to a hundredth of its step. `q`: joint
/// angles, rad; `along`: weighted residual along the joint's Jacobian column; `square`: weighted square of that column.
/// All of size N.
[[nodiscard]] FoundOrder search_order(const Eigen::VectorXd& q, const Eigen::VectorXd& along,
                                      const Eigen::VectorXd& square, const ErrorSource::Search& search);

}  // namespace trammel
