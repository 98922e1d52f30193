#include "server/diagnose/evidence/background.h"

#include <optional>
#include <utility>

#include "server/numerics/product.h"

namespace trammel::cause_search {

using Eigen::Index;
using Eigen::MatrixXd;

namespace {

MatrixXd information_of(const MatrixXd& columns) {
  MatrixXd information = gram(columns);
  information.diagonal().array() += 1;
  return information;
}

}  // namespace

MatrixXd inverse_factor_of(const MatrixXd& information) {
  if (std::optional<MatrixXd> inverse = inverse_factor(information)) return std::move(*inverse);
  const Index n = information.rows();  // to rounding
  return information.llt().matrixL().solve(MatrixXd::Identity(n, n));
}

Background::Background(MatrixXd columns)
    : columns_(std::move(columns)),
      information_(information_of(columns_)),
      inverse_(inverse_factor_of(information_)) {}

Background::Background(MatrixXd columns, MatrixXd information)
    : columns_(std::move(columns)),
      information_(std::move(information)),
      inverse_(inverse_factor_of(information_)) {}

Background Background::part(const std::vector<Index>& places) const {
  return {columns_(Eigen::all, places), information_(places, places)};
}

const MatrixXd& Background::root() const {
  if (root_.size() == 0) root_ = times_lower_transposed(columns_, inverse_);
  return root_;
}

MatrixXd Background::project(const MatrixXd& y) const { return y - columns_ * estimate(y); }

MatrixXd Background::estimate(const MatrixXd& y) const {
  return inverse_.transpose() * (inverse_ * transposed_product(columns_, y));
}

MatrixXd Background::covariance() const { return gram(inverse_); }

}  // namespace trammel::cause_search
