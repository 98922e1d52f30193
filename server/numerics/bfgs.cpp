#include "server/numerics/bfgs.h"

#include <algorithm>
#include <cmath>

namespace trammel {
namespace {

constexpr double kSufficientDecrease =
    1e-4;  // share of the decrease that the slope predicts: Nocedal & Wright, section 3.1
constexpr double kLeastCurvature =
    1e-10;  // cosine of step and change of gradient: below it is rounding
constexpr double kLeastDecrease =
    1e-3;  // of the tolerance: a shorter step is not worth an evaluation

// Eq. 6.17. A step along which the curvature is not positive is left out: the matrix stays positive
// definite.
void update_inverse_hessian(const Eigen::VectorXd& step, const Eigen::VectorXd& change,
                            Eigen::MatrixXd* inverse) {
  const double curvature = step.dot(change);
  if (!(curvature > kLeastCurvature * step.norm() * change.norm())) return;
  const Eigen::VectorXd mapped = *inverse * change;
  const double scale = (1.0 + change.dot(mapped) / curvature) / curvature;
  *inverse += scale * step * step.transpose() -
              (mapped * step.transpose() + step * mapped.transpose()) / curvature;
}

// The minimum of the parabola through the value and slope at 0 and the value at `length`, kept off
// both ends.
double shorter(double length, double value, double slope, double new_value) {
  if (!std::isfinite(new_value)) return 0.25 * length;
  const double parabola = -slope * length * length / (2.0 * (new_value - value - slope * length));
  return std::clamp(parabola, 0.1 * length, 0.5 * length);
}

}  // namespace

BfgsResult minimise(const Objective& objective, const Eigen::VectorXd& start,
                    const Eigen::MatrixXd& inverse_hessian, const BfgsOptions& options) {
  BfgsResult result;
  ObjectiveValue here;
  result.evaluations = 1;
  if (!objective(start, &here)) return result;
  result.defined = true;
  result.x = start;
  result.inverse_hessian = inverse_hessian;

  while (result.evaluations < options.max_evaluations) {
    Eigen::VectorXd direction = -result.inverse_hessian * here.gradient;
    double slope = direction.dot(here.gradient);
    if (!(slope < 0)) {
      direction = -here.gradient;
      slope = -here.gradient.squaredNorm();
    }
    if (-0.5 * slope < options.tolerance) {
      result.converged = true;
      break;
    }
    double length = std::min(1.0, options.max_step / direction.cwiseAbs().maxCoeff());
    ObjectiveValue there;
    bool accepted = false;
    while (!accepted && result.evaluations < options.max_evaluations) {
      ++result.evaluations;
      const bool defined = objective(result.x + length * direction, &there);
      accepted = defined && there.value <= here.value + kSufficientDecrease * length * slope;
      if (!accepted) {
        length = shorter(length, here.value, slope, defined ? there.value : std::nan(""));
        if (-length * slope < kLeastDecrease * options.tolerance) break;
      }
    }
    if (!accepted) break;
    update_inverse_hessian(length * direction, there.gradient - here.gradient,
                           &result.inverse_hessian);
    result.x += length * direction;
    std::swap(here, there);
  }
  result.value = here.value;
  result.gradient = here.gradient;
  return result;
}

}  // namespace trammel
