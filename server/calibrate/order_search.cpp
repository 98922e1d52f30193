#include "server/calibrate/order_search.h"

#include <algorithm>

namespace trammel {

namespace {

FoundOrder fit_order(const Eigen::VectorXd& q, const Eigen::VectorXd& along, const Eigen::VectorXd& square,
                     double order) {
  const Eigen::ArrayXd sine = (order * q.array()).sin();
  const Eigen::ArrayXd cosine = (order * q.array()).cos();
  Eigen::Matrix2d normal;
  normal(0, 0) = (square.array() * sine * sine).sum();
  normal(0, 1) = normal(1, 0) = (square.array() * sine * cosine).sum();
  normal(1, 1) = (square.array() * cosine * cosine).sum();
  // A hair of damping: near order 0, or with few poses, the two columns are alike.
  normal += 1e-9 * normal.trace() * Eigen::Matrix2d::Identity();
  const Eigen::Vector2d right((along.array() * sine).sum(), (along.array() * cosine).sum());
  const Eigen::Vector2d amplitude = normal.inverse() * right;
  return {order, amplitude(0), amplitude(1), amplitude.dot(right)};
}

}  // namespace

FoundOrder search_order(const Eigen::VectorXd& q, const Eigen::VectorXd& along, const Eigen::VectorXd& square,
                        const ErrorSource::Search& search) {
  FoundOrder best;
  const auto consider = [&](double order) {
    const FoundOrder candidate = fit_order(q, along, square, std::max(order, search.from));
    if (candidate.gain > best.gain) best = candidate;
  };
  for (double order = search.from; order <= search.to; order += search.step) consider(order);
  for (double step = search.step / 4; step > search.step / 100; step /= 2) {
    const double centre = best.order;
    for (int k = -4; k <= 4; ++k) consider(centre + k * step);
  }
  return best;
}

}  // namespace trammel
