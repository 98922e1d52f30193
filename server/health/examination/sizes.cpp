#include "server/health/examination/sizes.h"

#include <algorithm>
#include <cmath>

namespace trammel::health {

Size size_of(const Estimate& found, const Eigen::MatrixXd& square) {
  const double whole = found.numbers.dot(square * found.numbers);
  const double by_noise = (square * found.covariance).trace();
  const Eigen::VectorXd gradient = square * found.numbers / std::max(std::sqrt(whole), 1e-12);
  return {std::sqrt(std::max(whole - by_noise, 0.0)),
          2 * std::sqrt(gradient.dot(found.covariance * gradient))};
}

Size size_of_any(const Estimate& found, double rms) {
  const auto poses = static_cast<double>(found.numbers.size());
  const double by_noise = found.covariance.trace() / poses;
  const double square = std::max(found.numbers.squaredNorm() / poses - by_noise, 0.0);
  return {rms * std::sqrt(square), 2 * rms * std::sqrt(by_noise / 2)};
}

}  // namespace trammel::health
