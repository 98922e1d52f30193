#include "server/calibrate/maps/linear_arm.h"

#include <cmath>

#include "server/calibrate/identify/weighted_pose.h"
#include "server/numerics/product.h"

namespace trammel {

namespace {

using Eigen::Index;

constexpr Index kRowsAtATime = 768;  // multiplied together: their factors stay in the cache

/// Equations of one kind, filled row by row.
class Rows {
 public:
  Rows(LinearEquations& into, Index parameters)
      : into_(into), J_(kRowsAtATime, parameters), r_(kRowsAtATime) {
    into_.information = Eigen::MatrixXd::Zero(parameters, parameters);
    into_.downhill = Eigen::VectorXd::Zero(parameters);
  }
  /// `J`: one column per equation. `square`: the expected square of each.
  void add(const Eigen::Ref<const Eigen::VectorXd>& r, const Eigen::Ref<const Eigen::MatrixXd>& J,
           double square) {
    into_.count += square * static_cast<double>(r.size());
    if (filled_ + r.size() > kRowsAtATime) add_filled();
    r_.segment(filled_, r.size()) = r;
    J_.middleRows(filled_, r.size()) = J.transpose();
    filled_ += r.size();
  }
  void add_filled() {
    J_.bottomRows(kRowsAtATime - filled_).setZero();
    r_.tail(kRowsAtATime - filled_).setZero();
    into_.information += gram(J_);
    into_.downhill.noalias() -= J_.transpose() * r_;
    into_.square += r_.squaredNorm();
    filled_ = 0;
  }

 private:
  LinearEquations& into_;
  Eigen::MatrixXd J_;
  Eigen::VectorXd r_;
  Index filled_ = 0;
};

/// The expected square of a coordinate of this position under its weight. It is less than 1 if rows
/// at one joint vector share an error, and together weigh as one pose.
double expected_square(const CalibrationProblem& problem, const Weights& weights, std::size_t row) {
  const Measurement& m = problem.batch.measurements[row];
  const double sigma = position_sigma(m, *problem.model.cell);
  return std::pow(
      std::hypot(sigma, weights.beside_alone(m)) / std::hypot(sigma, weights.beside(m, row)), 2);
}

}  // namespace

LinearArm linear_arm(const CalibrationProblem& problem, const Weights& weights) {
  LinearArm arm{scaled_parameters(problem.model, {}), {}};
  const Index P = arm.scaled.scale.size();
  Rows places(arm.kinds[0], P), turns(arm.kinds[1], P);
  const Eigen::VectorXd x = arm.scaled.prior;
  Eigen::VectorXd r(6);
  Eigen::MatrixXd J(P, 6);
  for (std::size_t row = 0; row < problem.batch.measurements.size(); ++row) {
    const WeightedPose pose(problem.model, arm.scaled, problem.batch.measurements[row], weights,
                            row);
    if (!pose.evaluate(x.data(), r.data(), J.data())) continue;
    const Index size = pose.size();
    const Index of_place = std::min<Index>(size, 3);
    const double norm = r.head(size).norm();
    const double root_weight = norm > pose.huber_limit() ? std::sqrt(pose.huber_limit() / norm) : 1;
    places.add(root_weight * r.head(of_place), root_weight * J.leftCols(of_place),
               expected_square(problem, weights, row));
    if (size > 3) turns.add(root_weight * r.tail(3), root_weight * J.rightCols(3), 1);
  }
  places.add_filled();
  turns.add_filled();
  return arm;
}

}  // namespace trammel
