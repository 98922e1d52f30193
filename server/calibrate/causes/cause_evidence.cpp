#include "server/calibrate/causes/cause_evidence.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "server/numerics/product.h"

namespace trammel {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kRounds = 12;          // to find the noise
constexpr double kSameNoise = 0.01;  // of its precision
constexpr double kLeastFreedom = 1;  // equations beyond the parameters

/// Rows of a batch by themselves, and how they are weighed.
LinearArm block_equations(const CalibrationProblem& problem, const Weights& weights,
                          const std::vector<std::size_t>& rows) {
  CalibrationProblem part{problem.model, problem.batch};
  part.batch.measurements.clear();
  Weights of_part = weights;
  of_part.together.clear();
  for (const std::size_t row : rows) {
    part.batch.measurements.push_back(problem.batch.measurements[row]);
    if (!weights.together.empty()) of_part.together.push_back(weights.together[row]);
  }
  LinearArm arm = linear_arm(part, of_part);
  for (LinearEquations& kind : arm.kinds) {
    if (kind.count > 0) continue;
    kind = {};  // their zeros would fill the memory
  }
  return arm;
}

void add_equations(const LinearEquations& part, LinearEquations& sum) {
  if (part.count == 0) return;
  if (sum.count == 0) {
    sum = part;
    return;
  }
  sum.information += part.information;
  sum.downhill += part.downhill;
  sum.square += part.square;
  sum.count += part.count;
}

LinearEquations of_columns(const LinearEquations& all, const std::vector<Index>& columns) {
  LinearEquations some = all;
  some.information = all.information(columns, columns);
  some.downhill = all.downhill(columns);
  return some;
}

/// For each kind, the factor by which the stated sigmas are more precise than the weights, as a
/// variance.
Eigen::Vector2d of_stated_sigmas(const CalibrationProblem& problem, const Weights& weights) {
  Eigen::Vector2d stated = Eigen::Vector2d::Zero(), beside = Eigen::Vector2d::Zero();
  for (std::size_t i = 0; i < problem.batch.measurements.size(); ++i) {
    const Measurement& m = problem.batch.measurements[i];
    const Cell& cell = *problem.model.cell;
    stated +=
        Eigen::Vector2d(std::pow(position_sigma(m, cell), 2), std::pow(rotation_sigma(m, cell), 2));
    beside += Eigen::Vector2d(std::pow(weights.beside(m, i), 2),
                              std::pow(weights.discrepancy_rotation, 2));
  }
  return (beside.array() / stated.array() + 1).matrix();
}

/// Squared residuals after the change `d`.
double residual_square(const LinearEquations& equations, const VectorXd& d) {
  return equations.square - 2 * equations.downhill.dot(d) + d.dot(equations.information * d);
}

}  // namespace

CauseEvidence::CauseEvidence(const CalibrationProblem& problem, const Weights& weights,
                             const std::vector<std::vector<std::size_t>>& blocks,
                             const std::vector<ColumnGroup>& present) {
  for (const std::vector<std::size_t>& rows : blocks) {
    blocks_.push_back(block_equations(problem, weights, rows));
    for (std::size_t k = 0; k < all_.kinds.size(); ++k)
      add_equations(blocks_.back().kinds[k], all_.kinds[k]);
  }
  all_.scaled = blocks_.front().scaled;
  most_precision_ = of_stated_sigmas(problem, weights);
  for (const ColumnGroup& group : present) add_free(group);
  free_anew();
}

void CauseEvidence::add_free(const ColumnGroup& group) {
  for (Index k = 0; k < group.count; ++k) free_.push_back(group.first + k);
}

void CauseEvidence::take(const ColumnGroup& group) {
  add_free(group);
  free_anew();
}

void CauseEvidence::free_anew() {
  learn_precision();
  weigh_all();
  const Eigen::LLT<MatrixXd> factor(curvature_(free_, free_));
  const MatrixXd rows = factor.matrixL().solve(curvature_(free_, Eigen::all));
  const VectorXd whitened = factor.matrixL().solve(downhill_(free_));
  curvature_ -= gram(rows);
  downhill_ -= rows.transpose() * whitened;
}

/// Curvature and slope of all columns, under the priors and the present precision.
void CauseEvidence::weigh_all() {
  const Index P = all_.scaled.scale.size();
  curvature_ = MatrixXd::Identity(P, P);
  downhill_ = VectorXd::Zero(P);
  for (std::size_t k = 0; k < all_.kinds.size(); ++k) {
    if (all_.kinds[k].count == 0) continue;
    curvature_ += precision_(static_cast<Index>(k)) * all_.kinds[k].information;
    downhill_ += precision_(static_cast<Index>(k)) * all_.kinds[k].downhill;
  }
}

/// Sets the noise at which the residuals are as large as expected with the free groups fitted
/// (MacKay 1992).
void CauseEvidence::learn_precision() {
  const auto P = static_cast<Index>(free_.size());
  std::array<LinearEquations, 2> kinds;
  for (std::size_t k = 0; k < kinds.size(); ++k) {
    if (all_.kinds[k].count > 0) kinds[k] = of_columns(all_.kinds[k], free_);
  }
  for (int round = 0; round < kRounds; ++round) {
    MatrixXd curvature = MatrixXd::Identity(P, P);
    VectorXd downhill = VectorXd::Zero(P);
    for (std::size_t k = 0; k < kinds.size(); ++k) {
      if (kinds[k].count == 0) continue;
      curvature += precision_(static_cast<Index>(k)) * kinds[k].information;
      downhill += precision_(static_cast<Index>(k)) * kinds[k].downhill;
    }
    const std::optional<MatrixXd> factor = inverse_factor(curvature);
    if (!factor) return;
    const MatrixXd covariance = gram(*factor);
    const VectorXd d = covariance * downhill;
    const Eigen::Vector2d before = precision_;
    for (std::size_t k = 0; k < kinds.size(); ++k) {
      if (kinds[k].count == 0) continue;
      double& at = precision_(static_cast<Index>(k));
      const double told = at * kinds[k].information.cwiseProduct(covariance).sum();
      const double square = residual_square(kinds[k], d);
      if (square > 0)
        at = std::min(std::max(kinds[k].count - told, kLeastFreedom) / square,
                      most_precision_(static_cast<Index>(k)));
    }
    if (((precision_ - before).array().abs() < kSameNoise * before.array()).all()) return;
  }
}

CauseEvidence::Gain CauseEvidence::gain_of(const ColumnGroup& group) const {
  const Eigen::LLT<MatrixXd> factor(
      curvature_.block(group.first, group.first, group.count, group.count));
  const VectorXd whitened = factor.matrixL().solve(downhill_.segment(group.first, group.count));
  const double log_root = VectorXd(factor.matrixLLT().diagonal()).array().log().sum();
  const MatrixXd inverse = factor.solve(MatrixXd::Identity(group.count, group.count));
  return {0.5 * whitened.squaredNorm() - log_root,
          static_cast<double>(group.count) - inverse.trace()};
}

VectorXd CauseEvidence::left_out(const ColumnGroup& group) const {
  std::vector<Index> free = free_;
  for (Index k = 0; k < group.count; ++k) free.push_back(group.first + k);
  return left_out_with(free);
}

VectorXd CauseEvidence::left_out_with(const std::vector<Index>& free) const {
  const auto P = static_cast<Index>(free.size());
  VectorXd square = VectorXd::Zero(std::ssize(blocks_));
  for (Index b = 0; b < square.size(); ++b) {
    const LinearArm& block = blocks_[static_cast<std::size_t>(b)];
    MatrixXd curvature = MatrixXd::Identity(P, P);
    VectorXd downhill = VectorXd::Zero(P);
    for (std::size_t k = 0; k < block.kinds.size(); ++k) {
      if (all_.kinds[k].count == 0) continue;
      const double at = precision_(static_cast<Index>(k));
      curvature += at * all_.kinds[k].information(free, free);
      downhill += at * all_.kinds[k].downhill(free);
      if (block.kinds[k].count == 0) continue;
      curvature -= at * block.kinds[k].information(free, free);
      downhill -= at * block.kinds[k].downhill(free);
    }
    const Eigen::LLT<MatrixXd> factor(curvature);
    if (factor.info() != Eigen::Success)
      return VectorXd::Constant(square.size(), std::numeric_limits<double>::infinity());
    if (block.kinds.front().count == 0) continue;
    VectorXd d = VectorXd::Zero(all_.scaled.scale.size());
    const VectorXd of_free = factor.solve(downhill);
    d(free) = of_free;
    square(b) = residual_square(block.kinds.front(), d);
  }
  return square / std::max(all_.kinds.front().count, 1.0);
}

}  // namespace trammel
