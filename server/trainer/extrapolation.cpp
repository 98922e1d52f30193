#include "server/trainer/extrapolation.h"

#include <algorithm>
#include <cmath>

#include "server/compensate/domain.h"

namespace trammel {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kLeftOut = 1.0 / 3.0;  // of a joint's range, at one end
constexpr double kLeastRange = 0.02;    // rad or m; over less a slope is noise
constexpr Index kLeastAsked = 5;
constexpr Index kLeastRest = 10;

/// The batch as the identified physics sees it: residuals and derivatives in units of their standard deviations, the
/// parameters in directions in which they are independent with unit variance. Six rows a pose, zero where it has no
/// orientation.
struct Whitened {
  MatrixXd q;         // N x n
  VectorXd residual;  // 6 N
  MatrixXd J;         // 6 N x P
  VectorXd sigma;     // N, m, of one coordinate of the position
};

/// R with R Rᵀ the covariance, which may be singular or empty.
MatrixXd square_root(const MatrixXd& covariance) {
  if (covariance.size() == 0) return covariance;
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(covariance);
  return eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal();
}

Whitened whitened(const CalibrationResult& found, const MeasurementBatch& batch) {
  const PhysicalModel& model = found.model;
  std::vector<const Measurement*> asked;
  for (const Measurement& m : batch.measurements) {
    const bool suspect = std::any_of(found.suspects.begin(), found.suspects.end(), [&](const SuspectPose& pose) {
      return pose.pose_id == m.pose_id && pose.row == m.row;
    });
    if (!suspect) asked.push_back(&m);
  }
  const auto count = static_cast<Index>(asked.size());
  const Index P = model.parameter_count();
  const MatrixXd root = square_root(found.covariance);
  Whitened rows{MatrixXd(count, model.cell->robot.size()), VectorXd::Zero(6 * count), MatrixXd::Zero(6 * count, P),
                VectorXd(count)};
  MatrixXd J_W;
  for (Index i = 0; i < count; ++i) {
    const Measurement& m = *asked[static_cast<std::size_t>(i)];
    const Pose X_WT = model.pose_W(m.context, model.values, &J_W);
    rows.q.row(i) = m.context.q.transpose();
    rows.sigma(i) = std::hypot(m.sigma.value_or(model.cell->tracker.sigma), found.discrepancy);
    rows.residual.segment<3>(6 * i) = (m.p_W - X_WT.translation()) / rows.sigma(i);
    rows.J.middleRows<3>(6 * i) = J_W.topRows<3>() / rows.sigma(i);
    if (!m.R_WT) continue;
    const double turn = std::hypot(model.cell->tracker.sigma_rotation, found.discrepancy_rotation);
    rows.residual.segment<3>(6 * i + 3) = rotation_log(*m.R_WT * X_WT.linear().transpose()) / turn;
    rows.J.middleRows<3>(6 * i + 3) = J_W.bottomRows<3>() / turn;
  }
  rows.J = (rows.J * root).eval();
  return rows;
}

/// Squared slope of the poses `asked`, which are `distance` away from the `rest`.
double squared_slope(const Whitened& all, const std::vector<Index>& asked, const std::vector<Index>& rest,
                     const VectorXd& distance) {
  const auto count = static_cast<Index>(asked.size());
  MatrixXd J(6 * count, all.J.cols());
  VectorXd residual(6 * count);
  for (Index i = 0; i < count; ++i) {
    const Index row = 6 * asked[static_cast<std::size_t>(i)];
    J.middleRows<6>(6 * i) = all.J.middleRows<6>(row);
    residual.segment<6>(6 * i) = all.residual.segment<6>(row);
  }
  // The precision of the parameters without these poses; they answer for none of the gradient then.
  MatrixXd precision = MatrixXd::Identity(J.cols(), J.cols());
  VectorXd moved = VectorXd::Zero(J.cols());
  Eigen::LLT<MatrixXd> factor;
  if (J.cols() > 0) {
    precision.selfadjointView<Eigen::Lower>().rankUpdate(J.transpose(), -1.0);
    factor.compute(precision);
    if (factor.info() != Eigen::Success) return 0;
    moved = factor.solve(J.transpose() * residual);
  }

  // About the rest's mean: a constant is known, and what of it is not taken outside is counted there.
  const auto left_over = [&](Index i) -> Vector3 {
    return all.sigma(i) * (all.residual.segment<3>(6 * i) + all.J.middleRows<3>(6 * i) * moved);
  };
  Vector3 mean = Vector3::Zero();
  double square = 0;
  for (const Index i : rest) {
    mean += left_over(i) / static_cast<double>(rest.size());
    square += left_over(i).squaredNorm() / static_cast<double>(rest.size());
  }
  const double expected = square - mean.squaredNorm();
  double surplus = 0;
  for (Index i = 0; i < count; ++i) {
    const Index pose = asked[static_cast<std::size_t>(i)];
    MatrixXd uncertain = J.middleRows<3>(6 * i).transpose();
    if (J.cols() > 0) factor.matrixL().solveInPlace(uncertain);
    surplus +=
        (left_over(pose) - mean).squaredNorm() - expected - std::pow(all.sigma(pose), 2) * uncertain.squaredNorm();
  }
  return std::max(surplus, 0.0) / 3 / distance.squaredNorm();
}

/// The worse of both ends; empty where they cannot be asked.
std::optional<double> squared_slope(const Whitened& all, Index j, const Joint& joint) {
  const double low = all.q.col(j).minCoeff();
  const double high = all.q.col(j).maxCoeff();
  if (high - low < kLeastRange) return std::nullopt;
  std::optional<double> worst;
  for (const bool upper : {false, true}) {
    std::vector<Index> asked, rest;
    std::vector<double> distance;
    for (Index i = 0; i < all.q.rows(); ++i) {
      const double inward = upper ? high - all.q(i, j) : all.q(i, j) - low;
      const double beyond = kLeftOut * (high - low) - inward;
      (beyond > 0 ? asked : rest).push_back(i);
      if (beyond > 0) distance.push_back(distance_beyond(joint, beyond));
    }
    if (static_cast<Index>(asked.size()) < kLeastAsked || static_cast<Index>(rest.size()) < kLeastRest) continue;
    const Eigen::Map<const VectorXd> away(distance.data(), static_cast<Index>(distance.size()));
    worst = std::max(worst.value_or(0), squared_slope(all, asked, rest, away));
  }
  return worst;
}

}  // namespace

JointVector extrapolation_slope(const CalibrationResult& found, const MeasurementBatch& batch) {
  const Chain& robot = found.model.cell->robot;
  JointVector slope = JointVector::Zero(robot.size());
  const Whitened all = whitened(found, batch);
  if (all.q.rows() == 0) return slope;
  std::vector<Index> unknown;
  for (Index j = 0; j < slope.size(); ++j) {
    const std::optional<double> squared = squared_slope(all, j, robot.joint(static_cast<int>(j)));
    if (!squared) unknown.push_back(j);
    slope(j) = std::sqrt(squared.value_or(0));
  }
  const double largest = slope.maxCoeff();
  for (const Index j : unknown) slope(j) = largest;
  return slope;
}

}  // namespace trammel
