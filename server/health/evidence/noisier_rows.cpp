#include "server/health/evidence/noisier_rows.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "server/health/evidence/refitted_rows.h"

namespace trammel::health {

namespace {

using Eigen::Index;

constexpr std::array kFactors = {1.0, 1.2, 1.5, 2.0,
                                 3.0, 5.0, 8.0, 12.0};  // times the standard deviation

Eigen::MatrixXd noisier(const CheckRows& rows, Eigen::MatrixXd covariance, RowKind kind,
                        double factor) {
  constexpr Index kOfPosition = 3;
  for (std::size_t i = 0; i < rows.poses(); ++i) {
    const bool first = kind == RowKind::kPositions;
    const Index count = first ? kOfPosition : rows.count[i] - kOfPosition;
    covariance.diagonal().segment(rows.first[i] + (first ? 0 : kOfPosition), count) *=
        factor * factor;
  }
  return covariance;
}

double log_of_square(const Eigen::VectorXd& diagonal) {
  return 2 * diagonal.array().abs().log().sum();
}

}  // namespace

double gained_beside_noise(const CheckRows& rows, const Eigen::MatrixXd& covariance,
                           const Eigen::MatrixXd& refitted, const Eigen::MatrixXd& cause,
                           RowKind kind) {
  // The remaining columns before whitening, which are equal for every noise.
  const Eigen::MatrixXd basis =
      RefittedRows(covariance, Eigen::MatrixXd(rows.residual.size(), 0)).kept(refitted);
  double without = std::numeric_limits<double>::infinity(), with = without;
  for (const double factor : kFactors) {
    const Eigen::MatrixXd all = noisier(rows, covariance, kind, factor);
    const Eigen::LLT<Eigen::MatrixXd> root(all);
    const Eigen::MatrixXd whitened = root.matrixL().solve(basis);
    const Eigen::MatrixXd triangle = Eigen::HouseholderQR<Eigen::MatrixXd>(whitened).matrixQR();
    const double scale =
        log_of_square(root.matrixLLT().diagonal()) + log_of_square(triangle.diagonal());
    const RefittedRows beside(all, basis);
    const Eigen::VectorXd left = beside.left(rows.residual);
    const double explained = (beside.directions(cause).transpose() * left).squaredNorm();
    without = std::min(without, scale + left.squaredNorm());
    with = std::min(with, scale + left.squaredNorm() - explained);
  }
  return without - with;
}

}  // namespace trammel::health
