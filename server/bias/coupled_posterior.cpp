#include "server/bias/coupled_posterior.h"

#include <cmath>
#include <utility>

#include "server/bias/numerics.h"

namespace trammel {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

std::optional<CoupledPosterior> CoupledPosterior::condition(std::shared_ptr<const Kernel> kernel,
                                                            const LinearBlocks& blocks, const CoupledData& data,
                                                            const CoupledHyperparameters& at, VarianceForm form) {
  std::optional<CoupledSolution> solution = solve(*kernel, blocks, data, at);
  if (!solution) return std::nullopt;
  const Index n = data.q.rows();
  const Index p = blocks.column_count();
  CoupledPosterior posterior;
  posterior.points_ = n;
  posterior.hyperparameters_ = at.outputs;
  for (const AlignedMatrix& matrix : solution->eliminated) {
    posterior.explained_.emplace_back(matrix.map().block(n + 1, 0, p, n));
  }
  posterior.leave_one_out(*solution, data);
  posterior.column_scale_ = solution->column_scale;
  posterior.weights_ = solution->weights.cwiseProduct(solution->column_scale);
  posterior.log_likelihood_ = solution->log_likelihood;
  for (Index d = 0; d < data.y.cols(); ++d) {
    const auto output = static_cast<std::size_t>(d);
    const VectorXd own = data.y.col(d) - data.columns[output] * posterior.weights_;
    auto process = GaussianProcess::condition(kernel, data.q, own, data.noise_shape, at.outputs[output], form);
    if (!process) return std::nullopt;
    posterior.outputs_.push_back(std::move(*process));
  }
  posterior.kernel_ = std::move(kernel);
  posterior.root_ = std::move(solution->root);
  posterior.features_ = std::move(solution->features);
  return posterior;
}

// With B the rows and columns of C⁻¹ that belong to one pose: covariance B⁻¹, error B⁻¹ α.
void CoupledPosterior::leave_one_out(const CoupledSolution& solution, const CoupledData& data) {
  const Index outputs = data.y.cols();
  leave_one_out_mean_.resize(points_, outputs);
  leave_one_out_variance_.resize(points_, outputs);
  std::vector<MatrixXd> halves;  // L⁻¹ Hᵀ M⁻¹
  for (const MatrixXd& explained : explained_) halves.emplace_back(solution.root.matrixL().solve(explained));
  for (Index i = 0; i < points_; ++i) {
    MatrixXd B(outputs, outputs);
    for (Index d = 0; d < outputs; ++d) {
      const auto row = static_cast<std::size_t>(d);
      for (Index e = 0; e < outputs; ++e) B(d, e) = -halves[row].col(i).dot(halves[static_cast<std::size_t>(e)].col(i));
      B(d, d) -= solution.eliminated[row](i, i);
    }
    const MatrixXd covariance = B.inverse();
    leave_one_out_mean_.row(i) = data.y.row(i) - (covariance * solution.alpha.row(i).transpose()).transpose();
    leave_one_out_variance_.row(i) = covariance.diagonal().transpose();
  }
}

CoupledPrediction CoupledPosterior::predict(const JointVector& q, const MatrixXd& columns) const {
  const MatrixXd scaled = columns * column_scale_.asDiagonal();
  CoupledPrediction at{columns * weights_, common_covariance(q, scaled), scaled.rowwise().squaredNorm()};
  for (Index d = 0; d < columns.rows(); ++d) {
    const GaussianProcess& own = outputs_[static_cast<std::size_t>(d)];
    double mean = 0;
    own.mean(q.transpose(), &mean);
    const PosteriorVariance variance = own.variance(q.transpose()).front();
    at.mean[d] += mean;
    at.covariance(d, d) += variance.posterior;
    at.prior[d] += variance.prior;
  }
  return at;
}

MatrixXd CoupledPosterior::common_covariance(const JointVector& q, const MatrixXd& scaled) const {
  MatrixXd R = scaled.transpose();  // p x D
  AlignedMatrix cross(padded_rows(points_), 1);
  for (Index d = 0; d < scaled.rows(); ++d) {
    const auto output = static_cast<std::size_t>(d);
    const GpHyperparameters& at = hyperparameters_[output];
    MatrixXd target(1, kernel_->feature_count(q.size()));
    kernel_->features(at.kernel, q.transpose(), target.data(), 1);
    kernel_->tile(at.kernel, {features_[output].data(), points_, features_[output].rows()}, {target.data(), 1, 1},
                  cross.data(), cross.rows());
    R.col(d).noalias() -= std::exp(2 * at.log_signal_stddev) * (explained_[output] * cross.map().col(0).head(points_));
  }
  const MatrixXd half = root_.matrixL().solve(R);
  return half.transpose() * half;
}

}  // namespace trammel
