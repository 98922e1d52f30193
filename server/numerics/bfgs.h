#pragma once

#include <Eigen/Dense>
#include <functional>

namespace trammel {

struct ObjectiveValue {
  double value = 0;
  Eigen::VectorXd gradient;
};

/// A function and its gradient. Returns false where it is not defined; the search then takes a
/// shorter step.
using Objective = std::function<bool(const Eigen::VectorXd& x, ObjectiveValue* out)>;

struct BfgsOptions {
  int max_evaluations = 100;
  double tolerance = 1e-3;  ///< stop when the quadratic model promises less decrease than this
  double max_step = 2.0;    ///< largest change of one coordinate in one iteration
};

struct BfgsResult {
  Eigen::VectorXd x;
  double value = 0;
  Eigen::VectorXd gradient;
  Eigen::MatrixXd inverse_hessian;  ///< the approximation at x
  int evaluations = 0;
  bool defined =
      false;  ///< false: the function is undefined at the start, and no other member is set
  bool converged = false;  ///< the tolerance was met within the evaluations allowed
};

/// Minimises by BFGS with a backtracking line search (Nocedal & Wright, Numerical Optimization, ch.
/// 3 and 6).
[[nodiscard]] BfgsResult minimise(const Objective& objective, const Eigen::VectorXd& start,
                                  const Eigen::MatrixXd& inverse_hessian,
                                  const BfgsOptions& options);

}  // namespace trammel
