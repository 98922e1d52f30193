#include "server/diagnose/evidence/background.h"

#include <utility>

#include "server/numerics/product.h"

namespace trammel::cause_search {

using Eigen::MatrixXd;

namespace {

MatrixXd information_of(const MatrixXd& columns) {
  MatrixXd information = transposed_product(columns, columns);
  information.diagonal().array() += 1;
  return information;
}

}  // namespace

Background::Background(MatrixXd columns) : Background(columns, information_of(columns)) {}

Background::Background(MatrixXd columns, const MatrixXd& information)
    : columns_(std::move(columns)), factor_(information) {
  const MatrixXd inverse = factor_.matrixU().solve(MatrixXd::Identity(columns_.cols(), columns_.cols()));
  root_ = transposed_product(columns_.transpose(), inverse);
}

MatrixXd Background::project(const MatrixXd& y) const { return y - root_ * transposed_product(root_, y); }

MatrixXd Background::estimate(const MatrixXd& y) const { return factor_.solve(transposed_product(columns_, y)); }

MatrixXd Background::covariance() const { return factor_.solve(MatrixXd::Identity(columns_.cols(), columns_.cols())); }

}  // namespace trammel::cause_search
