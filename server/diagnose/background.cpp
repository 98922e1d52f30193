#include "server/diagnose/background.h"

#include <utility>

#include "server/diagnose/product.h"

namespace trammel {

using Eigen::MatrixXd;

namespace {

Eigen::LLT<MatrixXd> factor_of(const MatrixXd& columns) {
  MatrixXd information = transposed_product(columns, columns);
  information.diagonal().array() += 1;
  return information.llt();
}

}  // namespace

Background::Background(MatrixXd columns) : columns_(std::move(columns)), factor_(factor_of(columns_)) {
  const MatrixXd inverse = factor_.matrixU().solve(MatrixXd::Identity(columns_.cols(), columns_.cols()));
  root_ = transposed_product(columns_.transpose(), inverse);
}

MatrixXd Background::project(const MatrixXd& y) const { return y - root_ * transposed_product(root_, y); }

MatrixXd Background::estimate(const MatrixXd& y) const { return factor_.solve(transposed_product(columns_, y)); }

MatrixXd Background::covariance() const { return factor_.solve(MatrixXd::Identity(columns_.cols(), columns_.cols())); }

MatrixXd estimate_numbers(const MatrixXd& columns, const MatrixXd& y) {
  return factor_of(columns).solve(transposed_product(columns, y));
}

}  // namespace trammel
