#include "server/diagnose/search/folds.h"

#include <algorithm>
#include <numeric>

#include "server/measurement/pose_groups.h"
#include "server/numerics/product.h"

namespace trammel::cause_search {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index kFolds = 8;
constexpr Index kRunsPerFold = 5;  // so that every fold has poses from all of the batch

VectorXd ones_without(Index rows, const std::vector<Index>& held) {
  VectorXd keep = VectorXd::Ones(rows);
  keep(held).setZero();
  return keep;
}

}  // namespace

Folds::Folds(const LinearProblem& problem, MatrixXd columns) : columns_(std::move(columns)) {
  const std::vector<PoseGroup> poses = pose_groups(problem.batch());
  const Index folds = std::min(kFolds, std::ssize(poses));
  const Index run = std::max<Index>(1, std::ssize(poses) / (folds * kRunsPerFold));
  held_.resize(static_cast<std::size_t>(folds));
  for (Index p = 0; p < std::ssize(poses); ++p) {
    std::vector<Index>& rows = held_[static_cast<std::size_t>((p / run) % folds)];
    for (const Index i : poses[static_cast<std::size_t>(p)])
      for (Index k = 0; k < problem.row_count(i); ++k) rows.push_back(problem.first_row(i) + k);
  }
  total_ = MatrixXd::Identity(columns_.cols(), columns_.cols());
  for (const std::vector<Index>& rows : held_) {
    const MatrixXd Z = columns_(rows, Eigen::all);
    information_.push_back(gram(Z));
    total_ += information_.back();
  }
}

MatrixXd Folds::information_without(std::size_t fold) const { return total_ - information_[fold]; }

VectorXd Folds::held_out_residual(const VectorXd& data) const {
  std::vector<Index> all(static_cast<std::size_t>(columns_.cols()));
  std::iota(all.begin(), all.end(), Index{0});
  return held_out_residual(data, all);
}

VectorXd Folds::held_out_residual(const VectorXd& data, const std::vector<Index>& chosen) const {
  if (chosen.empty()) return data;
  const VectorXd right = columns_.transpose() * data;
  VectorXd left = data;
  for (std::size_t fold = 0; fold < held_.size(); ++fold) {
    const MatrixXd Z = columns_(held_[fold], Eigen::all);
    const VectorXd known = right - Z.transpose() * data(held_[fold]);
    const MatrixXd inverse = inverse_factor_of(information_without(fold)(chosen, chosen));
    const VectorXd numbers = inverse.transpose() * (inverse * VectorXd(known(chosen)));
    left(held_[fold]) -= Z(Eigen::all, chosen) * numbers;
  }
  return left;
}

VectorXd Folds::rest_beside(const Background& background, const VectorXd& keep,
                            const MatrixXd& columns, const VectorXd& data) const {
  const VectorXd known = keep.cwiseProduct(data);
  if (columns.cols() == 0) return data - columns_ * background.estimate(known);
  const MatrixXd kept = keep.asDiagonal() * columns;
  const MatrixXd information = kept.transpose() * background.project(kept) +
                               MatrixXd::Identity(columns.cols(), columns.cols());
  const VectorXd numbers = information.llt().solve(kept.transpose() * background.project(known));
  const VectorXd rest = known - kept * numbers;
  return data - columns * numbers - columns_ * background.estimate(rest);
}

Folds::Gain Folds::gain_of_selection(const VectorXd& data, const std::vector<FamilyPtr>& families,
                                     const Chance& chance,
                                     const std::function<bool(std::size_t)>& admitted) const {
  Gain gain;
  for (std::size_t fold = 0; fold < held_.size(); ++fold) {
    const std::vector<Index>& held = held_[fold];
    const VectorXd keep = ones_without(data.size(), held);
    const Background background(keep.asDiagonal() * columns_, information_without(fold));
    const Scan seen = scan(families, {background, &keep}, data, chance, admitted);
    const auto best = seen.strongest([](std::size_t) { return true; });
    const MatrixXd chosen =
        best ? families[*best]->columns(seen.best[*best]) : MatrixXd(data.size(), 0);
    gain.before +=
        VectorXd(rest_beside(background, keep, MatrixXd(data.size(), 0), data)(held)).squaredNorm();
    gain.after += VectorXd(rest_beside(background, keep, chosen, data)(held)).squaredNorm();
  }
  return gain;
}

}  // namespace trammel::cause_search
