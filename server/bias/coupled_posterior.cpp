#include "server/bias/coupled_posterior.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "server/base/check.h"
#include "server/bias/numerics.h"

namespace trammel {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr Index kRun = 10;  // poses that follow one another are left out together
constexpr Index kFolds = 3;
constexpr Index kTargets = 64;  // at once: the matrices pass through the cache once for all of them

}  // namespace

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
  posterior.leave_out(*solution, data);
  posterior.column_scale_ = solution->column_scale;
  posterior.prior_.resize(n, data.y.cols());
  posterior.weights_ = solution->weights.cwiseProduct(solution->column_scale);
  posterior.log_likelihood_ = solution->log_likelihood;
  for (Index d = 0; d < data.y.cols(); ++d) {
    const auto output = static_cast<std::size_t>(d);
    const VectorXd own = data.y.col(d) - data.columns[output] * posterior.weights_;
    auto process = GaussianProcess::condition(kernel, data.q, own, data.noise_shape, at.outputs[output], form);
    if (!process) return std::nullopt;
    posterior.outputs_.push_back(std::move(*process));
    VectorXd prior(n);
    kernel->diagonal(at.outputs[output].kernel,
                     {solution->features[output].data(), n, solution->features[output].rows()}, prior.data());
    posterior.prior_.col(d) = std::exp(2 * at.outputs[output].log_signal_stddev) * prior;
    posterior.prior_.col(d).noalias() += data.columns[output].cwiseAbs2() * posterior.column_scale_.cwiseAbs2();
  }
  posterior.kernel_ = std::move(kernel);
  posterior.root_ = std::move(solution->root);
  posterior.features_ = std::move(solution->features);
  return posterior;
}

// With B the rows and columns of C⁻¹ that belong to the poses left out: covariance B⁻¹, error B⁻¹ α.
void CoupledPosterior::leave_out(const CoupledSolution& solution, const CoupledData& data) {
  const Index outputs = data.y.cols();
  leave_one_out_mean_.resize(points_, outputs);
  leave_one_out_variance_.resize(points_, outputs);
  std::vector<MatrixXd> halves;  // L⁻¹ Hᵀ M⁻¹
  for (const MatrixXd& explained : explained_) halves.emplace_back(solution.root.matrixL().solve(explained));
  // Errors and their variances, output by output.
  const auto left_out = [&](const std::vector<Index>& poses) {
    const auto count = static_cast<Index>(poses.size());
    MatrixXd stacked(solution.A.rows(), outputs * count);
    VectorXd alpha(outputs * count);
    for (Index d = 0; d < outputs; ++d) {
      stacked.middleCols(d * count, count) = halves[static_cast<std::size_t>(d)](Eigen::all, poses);
      alpha.segment(d * count, count) = solution.alpha.col(d)(poses);
    }
    MatrixXd B = MatrixXd::Zero(outputs * count, outputs * count);
    B.selfadjointView<Eigen::Lower>().rankUpdate(stacked.transpose(), -1.0);
    for (Index d = 0; d < outputs; ++d) {
      B.block(d * count, d * count, count, count).triangularView<Eigen::Lower>() -=
          solution.eliminated[static_cast<std::size_t>(d)].map()(poses, poses);
    }
    const Index size = B.rows();
    const Index padded = padded_rows(size + 1);
    AlignedMatrix matrix(padded % 64 == 0 ? padded + kTargetBlock : padded, padded);
    matrix.map().topLeftCorner(size, size).triangularView<Eigen::Lower>() = B;
    matrix.map().row(size).head(size) = alpha.transpose();
    AlignedMatrix work(numerics().work_size(size + 1), 1);
    double log_det = 0;
    const bool positive = numerics().inverse_root(size, 1, matrix.data(), matrix.rows(), work.data(), &log_det);
    TRAMMEL_CHECK(positive);
    VectorXd variance(size);
    for (Index i = 0; i < size; ++i) variance[i] = matrix.map().col(i).segment(i, size - i).squaredNorm();
    return std::pair<VectorXd, VectorXd>(-matrix.map().row(size).head(size).transpose(), variance);
  };
  for (Index i = 0; i < points_; ++i) {
    const auto [error, variance] = left_out({i});
    leave_one_out_mean_.row(i) = data.y.row(i) - error.transpose();
    leave_one_out_variance_.row(i) = variance.transpose();
  }
  double surprise = 0;
  for (Index fold = 0; fold < kFolds; ++fold) {
    std::vector<Index> poses;
    for (Index i = 0; i < points_; ++i) {
      if (i / kRun % kFolds == fold) poses.push_back(i);
    }
    if (poses.empty()) break;
    const auto [error, variance] = left_out(poses);
    surprise += error.cwiseAbs2().cwiseQuotient(variance).sum();
  }
  surprise_ = surprise / static_cast<double>(points_ * outputs);
}

MatrixXd CoupledPosterior::mean(const MatrixXd& q, const std::vector<MatrixXd>& columns) const {
  MatrixXd mean(q.rows(), static_cast<Index>(columns.size()));
  for (Index d = 0; d < mean.cols(); ++d) {
    const auto output = static_cast<std::size_t>(d);
    outputs_[output].mean(q, mean.col(d).data());
    mean.col(d).noalias() += columns[output] * weights_;
  }
  return mean;
}

std::vector<CoupledPrediction> CoupledPosterior::predict(const MatrixXd& q,
                                                         const std::vector<MatrixXd>& columns) const {
  std::vector<CoupledPrediction> predictions;
  for (Index first = 0; first < q.rows(); first += kTargets) {
    const Index count = std::min(kTargets, q.rows() - first);
    std::vector<MatrixXd> few;
    for (const MatrixXd& all : columns) few.emplace_back(all.middleRows(first, count));
    predict_few(q.middleRows(first, count), few, &predictions);
  }
  return predictions;
}

void CoupledPosterior::predict_few(const MatrixXd& q, const std::vector<MatrixXd>& columns,
                                   std::vector<CoupledPrediction>* out) const {
  const auto outputs = static_cast<Index>(columns.size());
  const std::size_t before = out->size();
  const MatrixXd means = mean(q, columns);
  std::vector<MatrixXd> halves;
  for (Index i = 0; i < q.rows(); ++i)
    out->push_back({means.row(i).transpose(), MatrixXd(outputs, outputs), VectorXd(outputs)});
  for (Index d = 0; d < outputs; ++d) {
    const auto output = static_cast<std::size_t>(d);
    const MatrixXd scaled = columns[output] * column_scale_.asDiagonal();
    halves.push_back(half_covariance(q, scaled, d));
    const std::vector<PosteriorVariance> own = outputs_[output].variance(q);
    for (Index i = 0; i < q.rows(); ++i) {
      CoupledPrediction& at = (*out)[before + static_cast<std::size_t>(i)];
      const PosteriorVariance& variance = own[static_cast<std::size_t>(i)];
      for (Index e = 0; e <= d; ++e)
        at.covariance(d, e) = at.covariance(e, d) =
            halves[output].col(i).dot(halves[static_cast<std::size_t>(e)].col(i));
      at.covariance(d, d) += variance.posterior;
      at.prior[d] = scaled.row(i).squaredNorm() + variance.prior;
    }
  }
}

MatrixXd CoupledPosterior::half_covariance(const MatrixXd& q, const MatrixXd& scaled, Index d) const {
  const auto output = static_cast<std::size_t>(d);
  const GpHyperparameters& at = hyperparameters_[output];
  MatrixXd targets(q.rows(), kernel_->feature_count(q.cols()));
  kernel_->features(at.kernel, q, targets.data(), q.rows());
  AlignedMatrix cross(padded_rows(points_), q.rows());
  kernel_->tile(at.kernel, {features_[output].data(), points_, features_[output].rows()},
                {targets.data(), q.rows(), q.rows()}, cross.data(), cross.rows());
  MatrixXd R = scaled.transpose();
  R.noalias() -= std::exp(2 * at.log_signal_stddev) * (explained_[output] * cross.map().topRows(points_));
  root_.matrixL().solveInPlace(R);
  return R;
}

}  // namespace trammel
