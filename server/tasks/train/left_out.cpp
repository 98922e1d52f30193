#include "server/tasks/train/left_out.h"

#include <algorithm>
#include <cmath>

#include "server/measurement/pose_groups.h"

namespace trammel {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

/// J R with R Rᵀ the covariance, which may be singular or empty. Exact parameters have no part in
/// it. Each parameter is scaled by its own standard deviation: beside hundreds of kg m an unscaled
/// square root would lose angles and compliances.
MatrixXd times_square_root(const MatrixXd& J, const MatrixXd& covariance) {
  std::vector<Index> open;
  for (Index k = 0; k < covariance.rows(); ++k) {
    if (covariance(k, k) > 0) open.push_back(k);
  }
  if (open.empty()) return MatrixXd(J.rows(), 0);
  const VectorXd stddev = covariance.diagonal()(open).cwiseSqrt();
  const VectorXd inverse = stddev.cwiseInverse();
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(
      inverse.asDiagonal() * covariance(open, open) * inverse.asDiagonal());
  return J(Eigen::all, open) * stddev.asDiagonal() * eigen.eigenvectors() *
         eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal();
}

std::vector<const Measurement*> observations(const CalibrationResult& found,
                                             const MeasurementBatch& batch) {
  std::vector<const Measurement*> poses;
  for (const Measurement& m : batch.measurements) {
    if (m.gauge) continue;
    const bool suspect = std::any_of(
        found.suspects.begin(), found.suspects.end(),
        [&](const SuspectPose& pose) { return pose.pose_id == m.pose_id && pose.row == m.row; });
    if (!suspect) poses.push_back(&m);
  }
  return poses;
}

}  // namespace

LeftOut::LeftOut(const CalibrationResult& found, const MeasurementBatch& batch) {
  const PhysicalModel& model = found.model;
  const std::vector<int> together = counted_together(batch);
  const std::vector<const Measurement*> poses = observations(found, batch);
  const auto count = static_cast<Index>(poses.size());
  R_BW_ = model.X_WB.linear().transpose();
  q_.resize(count, model.cell->robot.size());
  residual_ = VectorXd::Zero(6 * count);
  J_ = MatrixXd::Zero(6 * count, model.parameter_count());
  sigma_.resize(count);
  MatrixXd J_W;
  for (Index i = 0; i < count; ++i) {
    const Measurement& m = *poses[static_cast<std::size_t>(i)];
    const Pose X_WT = model.pose_W(m.context, model.values, &J_W);
    q_.row(i) = m.context.q.transpose();
    const auto row = static_cast<std::size_t>(&m - batch.measurements.data());
    sigma_(i) = std::hypot(m.sigma.value_or(model.cell->tracker.sigma),
                           found.discrepancy_of_one(together.empty() ? 1 : together[row]));
    residual_.segment<3>(6 * i) = (m.p_W - X_WT.translation()) / sigma_(i);
    J_.middleRows<3>(6 * i) = J_W.topRows<3>() / sigma_(i);
    if (!m.R_WT) continue;
    const double turn = std::hypot(m.sigma_rotation.value_or(model.cell->tracker.sigma_rotation),
                                   found.discrepancy_rotation);
    residual_.segment<3>(6 * i + 3) = rotation_log(*m.R_WT * X_WT.linear().transpose()) / turn;
    J_.middleRows<3>(6 * i + 3) = J_W.bottomRows<3>() / turn;
  }
  J_ = times_square_root(J_, found.covariance);
}

std::optional<LeftOut::Without> LeftOut::without(const std::vector<Index>& poses) const {
  const auto count = static_cast<Index>(poses.size());
  Without result{MatrixXd(size(), 3), VectorXd::Zero(count)};
  VectorXd moved = VectorXd::Zero(J_.cols());
  if (J_.cols() > 0) {
    MatrixXd J(6 * count, J_.cols());
    VectorXd residual(6 * count);
    for (Index i = 0; i < count; ++i) {
      const Index row = 6 * poses[static_cast<std::size_t>(i)];
      J.middleRows<6>(6 * i) = J_.middleRows<6>(row);
      residual.segment<6>(6 * i) = residual_.segment<6>(row);
    }
    // The precision of the parameters without these poses. The total gradient is 0 at the optimum,
    // so the gradient of the left-out poses is the negative of the gradient of the others.
    MatrixXd precision = MatrixXd::Identity(J.cols(), J.cols());
    if (count > 0) precision.selfadjointView<Eigen::Lower>().rankUpdate(J.transpose(), -1.0);
    const Eigen::LLT<MatrixXd> factor(precision);
    if (factor.info() != Eigen::Success) return std::nullopt;
    moved = factor.solve(J.transpose() * residual);
    for (Index i = 0; i < count; ++i) {
      const MatrixXd uncertain = factor.matrixL().solve(J.middleRows<3>(6 * i).transpose());
      result.variance(i) =
          std::pow(sigma_(poses[static_cast<std::size_t>(i)]), 2) * uncertain.squaredNorm() / 3;
    }
  }
  const VectorXd all = residual_ + J_ * moved;
  for (Index i = 0; i < size(); ++i) {
    result.residual_B.row(i) = (sigma_(i) * (R_BW_ * all.segment<3>(6 * i))).transpose();
  }
  return result;
}

}  // namespace trammel
