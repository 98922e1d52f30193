#include "server/bias/flange/flange_likelihood.h"

#include <cmath>
#include <utility>

#include "server/numerics/numerics.h"

namespace trammel {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Entries (i, j) of the kernels, one for each number of the twist, times the prior variances.
Vector6 covariance_at(const std::vector<AlignedMatrix>& kernels, const Vector6& variance, Index i,
                      Index j) {
  Vector6 at;
  for (Index d = 0; d < 6; ++d) at[d] = variance[d] * kernels[kernel_of(d)](i, j);
  return at;
}

// [C .; zᵀ 0], lower triangle.
AlignedMatrix assembled(const FlangeViews& views, const VectorXd& z,
                        const std::vector<AlignedMatrix>& kernels,
                        const CoupledHyperparameters& at) {
  AlignedMatrix matrix = factor_storage(views.size + 1);
  auto whole = matrix.map();
  const Vector6 variance = twist_variance(at);
  for (std::size_t j = 0; j < views.views.size(); ++j) {
    const FlangeView& b = views.views[j];
    for (std::size_t i = j; i < views.views.size(); ++i) {
      const FlangeView& a = views.views[i];
      const Vector6 k =
          covariance_at(kernels, variance, static_cast<Index>(i), static_cast<Index>(j));
      const TwistRows weighed = a.view * k.asDiagonal();
      whole.block(a.first, b.first, a.view.rows(), b.view.rows()) =
          weighed.lazyProduct(b.view.transpose());
    }
  }
  whole.diagonal().head(views.size).array() += std::exp(2 * at.outputs.front().log_noise_stddev);
  whole.row(views.size).head(views.size) = z.transpose();
  return matrix;
}

double log_likelihood(const FlangeViews& views, const SeenNumbers& seen, double quadratic,
                      double log_det, double log_noise) {
  const auto numbers = static_cast<double>(views.size + seen.beside_freedom);
  const double beside = seen.beside * std::exp(-2 * log_noise) +
                        2 * static_cast<double>(seen.beside_freedom) * log_noise;
  return -0.5 * (quadratic + log_det + beside + seen.log_shape + numbers * kLogTwoPi);
}

}  // namespace

std::vector<VectorXd> twist_parameters(const CoupledHyperparameters& at) {
  std::vector<VectorXd> parameters;
  for (const GpHyperparameters& output : at.outputs) parameters.push_back(output.kernel);
  parameters.emplace_back(at.blocks.head(at.blocks.size() - 1));
  return parameters;
}

Vector6 twist_variance(const CoupledHyperparameters& at) {
  Vector6 variance = Vector6::Constant(std::exp(2 * at.blocks[at.blocks.size() - 1]));
  for (std::size_t d = 0; d < at.outputs.size(); ++d)
    variance[static_cast<Index>(d)] = std::exp(2 * at.outputs[d].log_signal_stddev);
  return variance;
}

std::optional<FlangeSolution> solve(const Kernel& kernel, const FlangeViews& views,
                                    const SeenNumbers& seen, const CoupledHyperparameters& at) {
  const Index count = views.q.rows();
  const Index n = views.size;
  FlangeSolution solution;
  for (const VectorXd& parameters : twist_parameters(at)) {
    AlignedMatrix features(padded_rows(count), kernel.feature_count(views.q.cols()));
    kernel.features(parameters, views.q, features.data(), features.rows());
    const FeatureBlock all = rows_of(features, 0, count);
    AlignedMatrix covariance(padded_rows(count), count);
    kernel.tile(parameters, all, all, covariance.data(), covariance.rows());
    solution.covariance.push_back(std::move(covariance));
    solution.features.push_back(std::move(features));
  }
  solution.eliminated = assembled(views, seen.of_twist, solution.covariance, at);
  AlignedMatrix work(numerics().work_size(n + 1), 1);
  double log_det = 0;
  if (!numerics().sweep(n, 1, solution.eliminated.data(), solution.eliminated.rows(), work.data(),
                        &log_det))
    return std::nullopt;
  solution.alpha = solution.eliminated.map().row(n).head(n).transpose();
  solution.log_likelihood = log_likelihood(views, seen, -solution.eliminated(n, n), log_det,
                                           at.outputs.front().log_noise_stddev);
  return solution;
}

FlangeLikelihood::FlangeLikelihood(KernelPtr kernel, FlangeViews views, SeenNumbers seen,
                                   FlangePrior prior)
    : kernel_(std::move(kernel)),
      views_(std::move(views)),
      seen_(std::move(seen)),
      prior_(std::move(prior)),
      parameters_(kernel_->parameter_count(views_.q.cols())) {}

CoupledHyperparameters FlangeLikelihood::unpack(const VectorXd& x) const {
  CoupledHyperparameters at;
  const Index signals = 3 * parameters_;
  for (Index d = 0; d < 3; ++d)
    at.outputs.push_back({x.segment(d * parameters_, parameters_), x[signals + d], x[signals + 3]});
  at.blocks = x.tail(parameters_ + 1);
  return at;
}

VectorXd FlangeLikelihood::pack(const CoupledHyperparameters& at) const {
  VectorXd x(4 * parameters_ + 5);
  for (Index d = 0; d < 3; ++d) {
    const GpHyperparameters& output = at.outputs[static_cast<std::size_t>(d)];
    x.segment(d * parameters_, parameters_) = output.kernel;
    x[3 * parameters_ + d] = output.log_signal_stddev;
  }
  x[3 * parameters_ + 3] = at.outputs.front().log_noise_stddev;
  x.tail(parameters_ + 1) = at.blocks;
  return x;
}

std::vector<AlignedMatrix> FlangeLikelihood::by_covariance(const FlangeSolution& solution,
                                                           const Vector6& variance) const {
  const Index count = views_.q.rows();
  std::vector<AlignedMatrix> by;
  for (std::size_t c = 0; c < kTwistKernels; ++c) by.emplace_back(padded_rows(count), count);
  const auto inverse = solution.eliminated.map();
  for (Index j = 0; j < count; ++j) {
    const FlangeView& b = views_.views[static_cast<std::size_t>(j)];
    for (Index i = j; i < count; ++i) {
      const FlangeView& a = views_.views[static_cast<std::size_t>(i)];
      Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 6, 6> g =
          -inverse.block(a.first, b.first, a.view.rows(), b.view.rows());
      if (i == j) g = g.selfadjointView<Eigen::Lower>().toDenseMatrix().eval();
      g -= solution.alpha.segment(a.first, a.view.rows())
               .lazyProduct(solution.alpha.segment(b.first, b.view.rows()).transpose());
      const TwistRows turned = g.lazyProduct(b.view);
      const Vector6 each =
          a.view.cwiseProduct(turned).colwise().sum().transpose().cwiseProduct(variance);
      for (Index d = 0; d < 6; ++d) by[kernel_of(d)](i, j) += (i == j ? 0.5 : 1.0) * each[d];
    }
  }
  return by;
}

bool FlangeLikelihood::evaluate(const VectorXd& x, ObjectiveValue* out) const {
  if (!x.allFinite() || x.cwiseAbs().maxCoeff() > kMostLogParameter) return false;
  const CoupledHyperparameters at = unpack(x);
  const std::optional<FlangeSolution> solution = solve(*kernel_, views_, seen_, at);
  if (!solution) return false;
  out->value = -solution->log_likelihood;
  out->gradient = VectorXd::Zero(x.size());
  const std::vector<AlignedMatrix> by = by_covariance(*solution, twist_variance(at));
  const std::vector<VectorXd> parameters = twist_parameters(at);
  const Index count = views_.q.rows();
  for (std::size_t c = 0; c < kTwistKernels; ++c) {
    const bool rotation = c + 1 == kTwistKernels;
    const Index first = rotation ? 3 * parameters_ + 4 : static_cast<Index>(c) * parameters_;
    const FeatureBlock all = rows_of(solution->features[c], 0, count);
    kernel_->tile_gradient(parameters[c], all, all, by[c].data(), by[c].rows(),
                           out->gradient.data() + first);
    out->gradient[rotation ? x.size() - 1 : 3 * parameters_ + static_cast<Index>(c)] =
        2 *
        by[c].map().topRows(count).cwiseProduct(solution->covariance[c].map().topRows(count)).sum();
  }
  const double noise = std::exp(2 * x[3 * parameters_ + 3]);
  const double trace = -solution->eliminated.map().diagonal().head(views_.size).sum();
  out->gradient[3 * parameters_ + 3] = noise * (trace - solution->alpha.squaredNorm()) -
                                       seen_.beside / noise +
                                       static_cast<double>(seen_.beside_freedom);
  add_prior(x, out);
  return std::isfinite(out->value) && out->gradient.allFinite();
}

void FlangeLikelihood::add_prior(const VectorXd& x, ObjectiveValue* out) const {
  const auto pull = [&](Index k, double centre, double spread) {
    const double away = (x[k] - centre) / spread;
    out->value += 0.5 * away * away;
    out->gradient[k] += away / spread;
  };
  const Index signals = 3 * parameters_;
  for (Index k = 0; k < signals; ++k)
    pull(k, prior_.parameter_centre[k % parameters_], prior_.parameter_spread);
  for (Index d = 0; d < 3; ++d) pull(signals + d, prior_.signal_centre, prior_.signal_spread);
  const double instrument = std::log(prior_.noise_stddev);
  if (x[signals + 3] < instrument) pull(signals + 3, instrument, prior_.noise_spread);
  for (Index k = 0; k <= parameters_; ++k)
    pull(signals + 4 + k, prior_.rotation_centre[k], prior_.rotation_spread);
}

}  // namespace trammel
