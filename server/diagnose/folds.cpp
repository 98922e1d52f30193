#include "server/diagnose/folds.h"

#include <algorithm>

namespace trammel {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index kFolds = 8;
constexpr Index kRunsPerFold = 5;

VectorXd predicted(const MatrixXd& columns, const VectorXd& data, const VectorXd& keep) {
  return columns * estimate_numbers(keep.asDiagonal() * columns, keep.cwiseProduct(data));
}

MatrixXd beside(const MatrixXd& a, const MatrixXd& b) {
  MatrixXd both(a.rows(), a.cols() + b.cols());
  both << a, b;
  return both;
}

}  // namespace

Folds::Folds(const LinearProblem& problem) {
  const Index folds = std::min(kFolds, problem.poses());
  const Index run = std::max<Index>(1, problem.poses() / (folds * kRunsPerFold));
  keep_.assign(static_cast<std::size_t>(folds), VectorXd::Ones(problem.rows()));
  for (Index i = 0; i < problem.poses(); ++i) {
    keep_[static_cast<std::size_t>((i / run) % folds)].segment(problem.first_row(i), problem.row_count(i)).setZero();
  }
}

VectorXd Folds::held_out_residual(const VectorXd& data, const MatrixXd& columns) const {
  VectorXd left = VectorXd::Zero(data.size());
  for (const VectorXd& keep : keep_) {
    left += (1 - keep.array()).matrix().cwiseProduct(data - predicted(columns, data, keep));
  }
  return left;
}

Folds::Gain Folds::gain_of_selection(const VectorXd& data, const MatrixXd& columns,
                                     const std::vector<FamilyPtr>& families, const Chance& chance,
                                     const std::function<bool(std::size_t)>& admitted) const {
  Gain gain;
  for (const VectorXd& keep : keep_) {
    const VectorXd held = 1 - keep.array();
    const Background background(keep.asDiagonal() * columns);
    const Scan seen = scan(families, {background, &keep}, data, chance, admitted);
    const auto chosen = seen.strongest([](std::size_t) { return true; });
    const double before = held.cwiseProduct(data - predicted(columns, data, keep)).squaredNorm();
    gain.before += before;
    gain.after +=
        chosen ? held.cwiseProduct(
                         data - predicted(beside(columns, families[*chosen]->columns(seen.best[*chosen])), data, keep))
                     .squaredNorm()
               : before;
  }
  return gain;
}

}  // namespace trammel
