#include "server/bias/coupled/coupled_likelihood.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "server/base/check.h"
#include "server/numerics/numerics.h"

namespace trammel {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// [σ_f² R + σ_n² diag(shape) .; yᵀ; Hᵀ 0], lower triangle.
AlignedMatrix assembled(const Kernel& kernel, const CoupledData& data, const GpHyperparameters& at,
                        const AlignedMatrix& features, const VectorXd& column_scale, Index output) {
  const Index n = data.q.rows();
  const Index p = column_scale.size();
  AlignedMatrix matrix = factor_storage(n + 1 + p);
  const double signal = std::exp(2 * at.log_signal_stddev);
  const double noise = std::exp(2 * at.log_noise_stddev);
  AlignedMatrix tile(4 * kTile + kRowPadding, kTile);
  for (Index j = 0; j < n; j += kTile) {
    const Index cols = std::min(kTile, n - j);
    for (Index i = j; i < n; i += 4 * kTile) {
      const Index rows = std::min(4 * kTile, n - i);
      kernel.tile(at.kernel, rows_of(features, i, rows), rows_of(features, j, cols), tile.data(),
                  tile.rows());
      matrix.map().block(i, j, rows, cols) = signal * tile.map().topLeftCorner(rows, cols);
    }
  }
  const MatrixXd& H = data.columns[static_cast<std::size_t>(output)];
  for (Index j = 0; j < n; ++j) {
    matrix(j, j) += noise * data.noise_shape[j];
    matrix(n, j) = data.y(j, output);
    matrix.map().col(j).segment(n + 1, p) = H.row(j).transpose().cwiseProduct(column_scale);
  }
  return matrix;
}

}  // namespace

std::optional<CoupledSolution> solve(const Kernel& kernel, const LinearBlocks& blocks,
                                     const CoupledData& data, const CoupledHyperparameters& at) {
  const Index n = data.q.rows();
  const Index p = blocks.column_count();
  const Index outputs = data.y.cols();
  CoupledSolution solution;
  VectorXd log_variance;
  blocks.log_variance(at.blocks, &log_variance, &solution.variance_slope);
  solution.column_scale = (0.5 * log_variance).array().exp();
  MatrixXd A = MatrixXd::Identity(p, p);
  VectorXd b = VectorXd::Zero(p);
  double minus_two = 0;
  for (Index d = 0; d < outputs; ++d) {
    const GpHyperparameters& output = at.outputs[static_cast<std::size_t>(d)];
    AlignedMatrix features(padded_rows(n), kernel.feature_count(data.q.cols()));
    kernel.features(output.kernel, data.q, features.data(), features.rows());
    AlignedMatrix matrix = assembled(kernel, data, output, features, solution.column_scale, d);
    AlignedMatrix work(numerics().work_size(n + 1 + p), 1);
    double log_det = 0;
    if (!numerics().sweep(n, 1 + p, matrix.data(), matrix.rows(), work.data(), &log_det))
      return std::nullopt;
    A.triangularView<Eigen::Lower>() -= matrix.map().block(n + 1, n + 1, p, p);
    b -= matrix.map().col(n).segment(n + 1, p);
    minus_two += -matrix(n, n) + log_det + static_cast<double>(n) * kLogTwoPi;
    solution.eliminated.push_back(std::move(matrix));
    solution.features.push_back(std::move(features));
  }
  solution.root.compute(A);
  if (solution.root.info() != Eigen::Success) return std::nullopt;
  solution.A = std::move(A);
  solution.weights = solution.root.solve(b);
  minus_two +=
      2 * solution.root.matrixLLT().diagonal().array().log().sum() - b.dot(solution.weights);
  solution.log_likelihood = -0.5 * minus_two;
  solution.alpha.resize(n, outputs);
  for (Index d = 0; d < outputs; ++d) {
    const auto matrix = solution.eliminated[static_cast<std::size_t>(d)].map();
    solution.alpha.col(d) = matrix.row(n).head(n).transpose();
    solution.alpha.col(d).noalias() -= matrix.block(n + 1, 0, p, n).transpose() * solution.weights;
  }
  return solution;
}

AlignedMatrix precision_of(const CoupledSolution& solution, Index points, Index output) {
  const Index n = points;
  const Index p = solution.weights.size();
  const AlignedMatrix& eliminated = solution.eliminated[static_cast<std::size_t>(output)];
  AlignedMatrix matrix = factor_storage(p + n);
  matrix.map().topLeftCorner(p, p) = solution.A;
  matrix.map().block(p, 0, n, p) = eliminated.map().block(n + 1, 0, p, n).transpose();
  matrix.map().block(p, p, n, n) = -eliminated.map().topLeftCorner(n, n);
  if (p == 0) return matrix;
  AlignedMatrix work(numerics().work_size(p + n), 1);
  double log_det = 0;
  const bool positive = numerics().sweep(p, n, matrix.data(), matrix.rows(), work.data(), &log_det);
  TRAMMEL_CHECK(positive);
  return matrix;
}

CoupledLikelihood::CoupledLikelihood(std::shared_ptr<const Kernel> kernel, LinearBlocks blocks,
                                     CoupledData data, CoupledPrior prior)
    : kernel_(std::move(kernel)),
      blocks_(std::move(blocks)),
      data_(std::move(data)),
      prior_(std::move(prior)),
      kernel_parameters_(kernel_->parameter_count(data_.q.cols())) {
  TRAMMEL_CHECK(static_cast<Index>(data_.columns.size()) == outputs());
}

CoupledHyperparameters CoupledLikelihood::unpack(const VectorXd& x) const {
  CoupledHyperparameters at;
  const Index scales = kernel_sets() * kernel_parameters_;
  for (Index d = 0; d < outputs(); ++d) {
    const Index set = prior_.shared_scales ? 0 : d;
    at.outputs.push_back({x.segment(set * kernel_parameters_, kernel_parameters_), x[scales + d],
                          x[scales + outputs() + d]});
  }
  at.blocks = x.tail(blocks_.parameter_count());
  return at;
}

VectorXd CoupledLikelihood::pack(const CoupledHyperparameters& at) const {
  const Index scales = kernel_sets() * kernel_parameters_;
  VectorXd x(scales + 2 * outputs() + blocks_.parameter_count());
  for (Index d = 0; d < outputs(); ++d) {
    const GpHyperparameters& output = at.outputs[static_cast<std::size_t>(d)];
    if (d < kernel_sets()) x.segment(d * kernel_parameters_, kernel_parameters_) = output.kernel;
    x[scales + d] = output.log_signal_stddev;
    x[scales + outputs() + d] = output.log_noise_stddev;
  }
  x.tail(blocks_.parameter_count()) = at.blocks;
  return x;
}

bool CoupledLikelihood::evaluate(const VectorXd& x, ObjectiveValue* out) const {
  if (!x.allFinite() || x.cwiseAbs().maxCoeff() > kMostLogParameter) return false;
  const CoupledHyperparameters at = unpack(x);
  const std::optional<CoupledSolution> solution = solve(*kernel_, blocks_, data_, at);
  if (!solution) return false;
  out->value = -solution->log_likelihood;
  out->gradient = VectorXd::Zero(x.size());
  const Index scales = kernel_sets() * kernel_parameters_;
  const Index p = blocks_.column_count();
  VectorXd inverse_diagonal;  // of A⁻¹
  for (Index d = 0; d < outputs(); ++d) {
    const AlignedMatrix precision = precision_of(*solution, size(), d);
    if (d == 0) inverse_diagonal = -precision.map().diagonal().head(p);
    const VectorXd part =
        contract(*solution, at.outputs[static_cast<std::size_t>(d)], precision, d);
    const Index set = prior_.shared_scales ? 0 : d;
    out->gradient.segment(set * kernel_parameters_, kernel_parameters_) +=
        part.head(kernel_parameters_);
    out->gradient[scales + d] = part[kernel_parameters_];
    out->gradient[scales + outputs() + d] = part[kernel_parameters_ + 1];
  }
  if (blocks_.parameter_count() > 0) {
    // ½ (1 - (A⁻¹)_kk - ŵ_k²) by each log variance.
    const VectorXd slope =
        0.5 * (1.0 - inverse_diagonal.array() - solution->weights.array().square());
    out->gradient.tail(blocks_.parameter_count()) = solution->variance_slope.transpose() * slope;
  }
  add_prior(x, out);
  return std::isfinite(out->value) && out->gradient.allFinite();
}

VectorXd CoupledLikelihood::contract(const CoupledSolution& solution, const GpHyperparameters& at,
                                     const AlignedMatrix& precision, Index output) const {
  const Index n = size();
  const Index p = solution.weights.size();
  const AlignedMatrix& features = solution.features[static_cast<std::size_t>(output)];
  const double signal = std::exp(2 * at.log_signal_stddev);
  const double noise = std::exp(2 * at.log_noise_stddev);
  VectorXd gradient = VectorXd::Zero(kernel_parameters_ + 2);
  AlignedMatrix weight(kTile, kTile);
  AlignedMatrix value(kTile + kRowPadding, kTile);
  const auto alpha = solution.alpha.col(output);
  for (Index j = 0; j < n; j += kTile) {
    const Index cols = std::min(kTile, n - j);
    for (Index i = j; i < n; i += kTile) {
      const Index rows = std::min(kTile, n - i);
      auto g = weight.map();
      g.setZero();
      g.topLeftCorner(rows, cols) =
          signal * (precision.map().block(p + i, p + j, rows, cols) -
                    alpha.segment(i, rows) * alpha.segment(j, cols).transpose());
      if (i == j) {
        g.triangularView<Eigen::StrictlyUpper>().setZero();
        g.diagonal() *= 0.5;
        gradient[kernel_parameters_ + 1] +=
            2 * noise / signal * g.diagonal().head(cols).dot(data_.noise_shape.segment(j, cols));
      }
      kernel_->tile(at.kernel, rows_of(features, i, rows), rows_of(features, j, cols), value.data(),
                    value.rows());
      gradient[kernel_parameters_] +=
          2 * g.topLeftCorner(rows, cols).cwiseProduct(value.map().topLeftCorner(rows, cols)).sum();
      kernel_->tile_gradient(at.kernel, rows_of(features, i, rows), rows_of(features, j, cols),
                             g.data(), kTile, gradient.data());
    }
  }
  return gradient;
}

void CoupledLikelihood::add_prior(const VectorXd& x, ObjectiveValue* out) const {
  const auto pull = [&](Index k, double centre, double spread) {
    const double away = (x[k] - centre) / spread;
    out->value += 0.5 * away * away;
    out->gradient[k] += away / spread;
  };
  const Index scales = kernel_sets() * kernel_parameters_;
  for (Index k = 0; k < scales; ++k)
    pull(k, prior_.parameter_centre[k % kernel_parameters_], prior_.parameter_spread);
  for (Index d = 0; d < outputs(); ++d) {
    pull(scales + d, prior_.signal_centre[d], prior_.signal_spread);
    const Index noise = scales + outputs() + d;
    if (x[noise] < std::log(prior_.noise_stddev[d]))
      pull(noise, std::log(prior_.noise_stddev[d]), prior_.noise_spread);
  }
  const VectorXd centre = blocks_.start();
  const VectorXd spread = blocks_.spread();
  const Index first = scales + 2 * outputs();
  for (Index k = 0; k < centre.size(); ++k) pull(first + k, centre[k], spread[k]);
}

}  // namespace trammel
