#include "server/health/evidence/refitted_rows.h"

#include <algorithm>
#include <cmath>

namespace trammel::health {

namespace {

using Eigen::Index;

/// Orthonormal directions of columns whose lengths were `before`.
Eigen::MatrixXd span_of(Eigen::MatrixXd columns, const Eigen::VectorXd& before) {
  for (Index k = 0; k < columns.cols(); ++k) columns.col(k) /= std::max(before(k), 1e-300);
  if (columns.cols() == 0) return columns;
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(columns, Eigen::ComputeThinU);
  const Index rank = (svd.singularValues().array() > kLeastLeft).count();
  return svd.matrixU().leftCols(rank);
}

Eigen::VectorXd lengths(const Eigen::MatrixXd& columns) {
  return columns.colwise().norm().transpose();
}

/// One column per pose, since a function of the joint's angle may have any value at each pose.
Eigen::MatrixXd by_pose(const CheckRows& rows, Index column) {
  Eigen::MatrixXd columns =
      Eigen::MatrixXd::Zero(rows.residual.size(), static_cast<Index>(rows.poses()));
  for (std::size_t i = 0; i < rows.poses(); ++i) {
    columns.col(static_cast<Index>(i)).segment(rows.first[i], rows.count[i]) =
        rows.by_cause.col(column).segment(rows.first[i], rows.count[i]);
  }
  return columns;
}

}  // namespace

std::vector<Hypothesis> cause_hypotheses(const CauseEffects& effects, const CheckRows& rows,
                                         const std::vector<CauseSignal>& signals) {
  std::vector<Hypothesis> all;
  for (const CauseSignal& signal : signals) {
    if (!all.empty() && all.back().cause == signal.cause) continue;
    const CauseEffects::Entry& entry = effects.causes()[signal.cause];
    all.push_back({signal.cause, -1,
                   entry.cause.any_function
                       ? by_pose(rows, entry.columns.front())
                       : Eigen::MatrixXd(rows.by_cause(Eigen::all, entry.columns))});
  }
  return all;
}

std::vector<Hypothesis> pose_hypotheses(const CheckRows& rows) {
  std::vector<Hypothesis> all;
  for (std::size_t i = 0; i < rows.poses(); ++i) {
    Eigen::MatrixXd columns = Eigen::MatrixXd::Zero(rows.residual.size(), rows.count[i]);
    columns.middleRows(rows.first[i], rows.count[i]).setIdentity();
    all.push_back({0, static_cast<int>(i), std::move(columns)});
  }
  return all;
}

Estimate estimate(const Eigen::MatrixXd& own, const Eigen::VectorXd& left, double widest) {
  Eigen::MatrixXd information = own.transpose() * own;
  information.diagonal().array() += 1 / (widest * widest);
  const Eigen::LLT<Eigen::MatrixXd> factor(information);
  return {factor.solve(own.transpose() * left),
          factor.solve(Eigen::MatrixXd::Identity(own.cols(), own.cols()))};
}

RefittedRows::RefittedRows(const Eigen::MatrixXd& covariance, const Eigen::MatrixXd& nuisance)
    : factor_(covariance) {
  const Eigen::MatrixXd columns = whitened(nuisance);
  nuisance_ = span_of(columns, lengths(columns));
}

Eigen::MatrixXd RefittedRows::whitened(const Eigen::MatrixXd& columns) const {
  return factor_.matrixL().solve(columns);
}

Eigen::MatrixXd RefittedRows::left(const Eigen::MatrixXd& columns) const {
  const Eigen::MatrixXd all = whitened(columns);
  return all - nuisance_ * (nuisance_.transpose() * all);
}

Eigen::MatrixXd RefittedRows::directions(const Eigen::MatrixXd& columns) const {
  return span_of(left(columns), lengths(whitened(columns)));
}

Eigen::MatrixXd RefittedRows::unwhitened(const Eigen::MatrixXd& left) const {
  return factor_.matrixL() * left;
}

Eigen::MatrixXd RefittedRows::unwhitened_covariance() const {
  const Eigen::MatrixXd all = Eigen::MatrixXd::Identity(nuisance_.rows(), nuisance_.rows()) -
                              nuisance_ * nuisance_.transpose();
  const Eigen::MatrixXd half = factor_.matrixL() * all;
  return half * half.transpose();
}

}  // namespace trammel::health
