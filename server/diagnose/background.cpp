#include "server/diagnose/background.h"

#include <utility>

namespace trammel {

using Eigen::MatrixXd;

Background::Background(MatrixXd columns) : columns_(std::move(columns)) {
  MatrixXd information = MatrixXd::Identity(columns_.cols(), columns_.cols());
  information.selfadjointView<Eigen::Lower>().rankUpdate(columns_.transpose());
  factor_.compute(information.selfadjointView<Eigen::Lower>());
  root_ = factor_.matrixL().solve(columns_.transpose()).transpose();
}

MatrixXd Background::project(const MatrixXd& y) const { return y - root_ * (root_.transpose() * y); }

MatrixXd Background::estimate(const MatrixXd& y) const { return factor_.solve(columns_.transpose() * y); }

MatrixXd Background::covariance() const { return factor_.solve(MatrixXd::Identity(columns_.cols(), columns_.cols())); }

}  // namespace trammel
