#include "server/bias/bias_model.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <utility>

#include "server/base/units.h"
#include "server/bias/hyperparameter_search.h"
#include "server/bias/kernel_spelling.h"
#include "server/bias/local_experts.h"

namespace trammel {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index kOutputs = 3;
constexpr Index kFewestObservations = 10;
constexpr double kSmallestSigma = 1e-7;  // m; no tracker knows a point better, whatever its file says
constexpr double kNoiseRatioMax = 4.0;   // of variance, either way: no point dominates by claiming 2 µm
constexpr double kSilence = 1e-9;        // m rms; an output below it has nothing to learn, and no scale to search with
constexpr std::string_view kNone = "none";
constexpr std::string_view kAxis[] = {"x", "y", "z"};

Status check_shape(const MatrixXd& q, const MatrixXd& residual_B, const VectorXd& sigma) {
  const Index n = q.rows();
  if (n < kFewestObservations) return refused("bias data: {} observations, at least {}", n, kFewestObservations);
  if (q.cols() < 1) return refused("bias data: 0 joints, at least 1");
  if (residual_B.rows() != n || residual_B.cols() != kOutputs)
    return refused("bias data: residual is {} x {}, should be {} x 3", residual_B.rows(), residual_B.cols(), n);
  if (sigma.size() != n) return refused("bias data: {} sigmas for {} observations", sigma.size(), n);
  return {};
}

Status check_numbers(const MatrixXd& q, const MatrixXd& residual_B, const VectorXd& sigma) {
  for (Index i = 0; i < q.rows(); ++i) {
    for (Index j = 0; j < q.cols(); ++j) {
      if (!std::isfinite(q(i, j)))
        return refused("bias data row {}: joint {} is {}, not finite", i + 1, j + 1, q(i, j));
    }
    for (Index d = 0; d < kOutputs; ++d) {
      if (!std::isfinite(residual_B(i, d)))
        return refused("bias data row {}: residual {} is {}, not finite", i + 1, kAxis[d], residual_B(i, d));
    }
    if (!std::isfinite(sigma[i]) || sigma[i] < 0)
      return refused("bias data row {}: sigma is {} mm, should be finite and not negative", i + 1, to_mm(sigma[i]));
  }
  return {};
}

Status check(const MatrixXd& q, const MatrixXd& residual_B, const VectorXd& sigma) {
  return check_shape(q, residual_B, sigma).and_then([&] { return check_numbers(q, residual_B, sigma); });
}

double median(VectorXd values) {
  const Index middle = values.size() / 2;
  std::nth_element(values.data(), values.data() + middle, values.data() + values.size());
  return values[middle];
}

VectorXd clipped(const VectorXd& sigma) { return sigma.cwiseMax(kSmallestSigma); }

// Noise variance of each point relative to the learned one: metrology's ratios, within reason.
VectorXd noise_shape(const VectorXd& sigma) {
  const VectorXd ratio = (clipped(sigma) / median(clipped(sigma))).cwiseAbs2();
  return ratio.cwiseMax(1.0 / kNoiseRatioMax).cwiseMin(kNoiseRatioMax);
}

// Rows as BiasState keeps them: kernel, log σ_f, log σ_n.
VectorXd as_column(const GpHyperparameters& h) {
  VectorXd column(h.kernel.size() + 2);
  column << h.kernel, h.log_signal_stddev, h.log_noise_stddev;
  return column;
}

// What stands for an output that is constant: no signal, metrology's noise.
GpHyperparameters silent(const VectorXd& kernel, double metrology_stddev) {
  return {kernel, std::log(kSilence), std::log(metrology_stddev)};
}

std::vector<Index> speaking_outputs(const MatrixXd& y) {
  std::vector<Index> outputs;
  for (Index d = 0; d < y.cols(); ++d) {
    if (y.col(d).norm() > kSilence * std::sqrt(static_cast<double>(y.rows()))) outputs.push_back(d);
  }
  return outputs;
}

GpHyperparameters from_column(const VectorXd& column) {
  const Index count = column.size() - 2;
  return {column.head(count), column[count], column[count + 1]};
}

}  // namespace

struct BiasModel::Fitted {
  BiasState state;
  BiasFitReport report;
  std::vector<LocalExperts> outputs;  // empty for `none`
  Vector3 stddev = Vector3::Zero();   // of the residual itself: all that `none` knows

  static Result<std::shared_ptr<Fitted>> from(const BiasState& state);
  MatrixXd leave_one_out_mean_B() const;
};

namespace {

double row_rms(const MatrixXd& rows) { return std::sqrt(rows.squaredNorm() / static_cast<double>(rows.rows())); }

BiasFitReport report_of(const std::vector<LocalExperts>& outputs, const MatrixXd& leave_one_out_error) {
  BiasFitReport report;
  for (Index d = 0; d < kOutputs; ++d) {
    const LocalExperts& output = outputs[static_cast<std::size_t>(d)];
    report.log_likelihood[d] = output.log_likelihood();
    report.noise_stddev[d] = std::sqrt(output.noise_variance());
  }
  report.leave_one_out_rms = row_rms(leave_one_out_error);
  return report;
}

// Independent Gaussian residuals about zero.
BiasFitReport report_of_none(const MatrixXd& residual_B, const Vector3& stddev) {
  const auto n = static_cast<double>(residual_B.rows());
  BiasFitReport report;
  report.noise_stddev = stddev;
  for (Index d = 0; d < kOutputs; ++d) {
    const double variance = std::max(stddev[d] * stddev[d], 1e-18);
    report.log_likelihood[d] =
        -0.5 * (residual_B.col(d).squaredNorm() / variance + n * std::log(2.0 * std::numbers::pi * variance));
  }
  report.leave_one_out_rms = row_rms(residual_B);
  return report;
}

}  // namespace

Result<std::shared_ptr<BiasModel::Fitted>> BiasModel::Fitted::from(const BiasState& state) {
  if (const Status fine = check(state.q, state.residual_B, state.sigma); !fine)
    return tl::make_unexpected(fine.error());
  auto fitted = std::make_shared<Fitted>();
  fitted->state = state;
  if (state.kernel == kNone) {
    fitted->stddev = state.residual_B.colwise().squaredNorm().transpose() / static_cast<double>(state.q.rows());
    fitted->stddev = fitted->stddev.cwiseSqrt().eval();
    fitted->report = report_of_none(state.residual_B, fitted->stddev);
    return fitted;
  }
  const auto kernel = spelled_kernel(state.kernel);
  if (!kernel) return tl::make_unexpected(kernel.error());
  const Index rows = (*kernel)->parameter_count(state.q.cols()) + 2;
  if (state.hyperparameters.rows() != rows || state.hyperparameters.cols() != kOutputs)
    return refused("bias state: hyperparameters are {} x {}, should be {} x 3 for kernel `{}`",
                   state.hyperparameters.rows(), state.hyperparameters.cols(), rows, state.kernel);
  if (state.offset.size() != kOutputs) return refused("bias state: {} offsets, should be 3", state.offset.size());
  if (!state.hyperparameters.allFinite() || !state.offset.allFinite())
    return refused("bias state: a hyperparameter or offset is not finite");

  const VectorXd shape = noise_shape(state.sigma);
  for (Index d = 0; d < kOutputs; ++d) {
    const VectorXd y = state.residual_B.col(d).array() - state.offset[d];
    auto output = LocalExperts::condition(*kernel, state.q, y, shape, from_column(state.hyperparameters.col(d)));
    if (!output)
      return refused("bias output {}: the covariance of {} observations is not positive definite", kAxis[d], y.size());
    fitted->outputs.push_back(*std::move(output));
  }
  fitted->report = report_of(fitted->outputs, state.residual_B - fitted->leave_one_out_mean_B());
  return fitted;
}

MatrixXd BiasModel::Fitted::leave_one_out_mean_B() const {
  MatrixXd mean = MatrixXd::Zero(state.q.rows(), kOutputs);
  for (std::size_t d = 0; d < outputs.size(); ++d) {
    const auto column = static_cast<Index>(d);
    mean.col(column) = outputs[d].leave_one_out_mean().array() + state.offset[column];
  }
  return mean;
}

Result<BiasModel> BiasModel::restore(const BiasState& state) {
  return Fitted::from(state).map([](std::shared_ptr<Fitted> fitted) { return BiasModel(std::move(fitted)); });
}

Result<BiasModel> BiasModel::fit(const BiasProblem& problem, const BiasOptions& options) {
  return fit_from(problem, options, nullptr);
}

Result<BiasModel> BiasModel::refit(const BiasOptions& options) const {
  const BiasState& state = fitted_->state;
  BiasOptions same_kernel = options;
  same_kernel.kernel = state.kernel;
  return fit_from({state.q, state.residual_B, state.sigma}, same_kernel, &state);
}

Result<BiasModel> BiasModel::fit_from(const BiasProblem& problem, const BiasOptions& options, const BiasState* last) {
  if (const Status fine = check(problem.q, problem.residual_B, problem.sigma); !fine)
    return tl::make_unexpected(fine.error());
  BiasState state{options.kernel, problem.q, problem.residual_B, problem.sigma, VectorXd::Zero(kOutputs), {}};
  if (options.kernel == kNone) return restore(state);
  const auto kernel = spelled_kernel(options.kernel);
  if (!kernel) return tl::make_unexpected(kernel.error());
  if (options.starts < 1) return refused("bias fit: {} starts, at least 1", options.starts);

  state.offset = problem.residual_B.colwise().mean().transpose();
  const MatrixXd y = problem.residual_B.rowwise() - state.offset.transpose();
  const double metrology_stddev = median(clipped(problem.sigma));
  const std::vector<Index> speaking = speaking_outputs(y);
  SearchResult found;
  const SearchBox box = (*kernel)->search_box(problem.q);
  const GpHyperparameters idle = silent(0.5 * (box.low + box.high), metrology_stddev);
  if (!speaking.empty()) {
    SearchOptions search{options.starts, options.seed, options.progress, {}};
    for (const Index d : speaking) {
      if (last != nullptr) search.last.push_back(from_column(last->hyperparameters.col(d)));
    }
    auto searched = search_hyperparameters(*kernel, {problem.q, y(Eigen::all, speaking), noise_shape(problem.sigma)},
                                           metrology_stddev, search);
    if (!searched)
      return refused("bias fit: no start of {} gave a positive definite covariance of {} observations", options.starts,
                     problem.q.rows());
    if (searched->given_up) return refused("bias fit: given up on request");
    found = *std::move(searched);
  }
  state.hyperparameters = as_column(idle).replicate(1, kOutputs);
  for (std::size_t i = 0; i < speaking.size(); ++i)
    state.hyperparameters.col(speaking[i]) = as_column(found.outputs[i]);

  // The same way in as a stored model, so that a restored one cannot differ.
  const auto fitted = Fitted::from(state);
  if (!fitted) return tl::make_unexpected(fitted.error());
  (*fitted)->report.starts_at_best = found.starts_at_best;
  (*fitted)->report.evaluations = found.evaluations;
  return BiasModel(*fitted);
}

Result<BiasModel> BiasModel::with(const BiasProblem& more) const {
  const BiasState& old = fitted_->state;
  if (more.q.cols() != old.q.cols())
    return refused("bias data: {} joints, the model has {}", more.q.cols(), old.q.cols());
  const Index n = old.q.rows() + more.q.rows();
  BiasState state = old;
  state.q.conservativeResize(n, Eigen::NoChange);
  state.q.bottomRows(more.q.rows()) = more.q;
  if (more.residual_B.rows() != more.q.rows() || more.residual_B.cols() != kOutputs ||
      more.sigma.size() != more.q.rows())
    return refused("bias data: residual or sigma does not have {} rows", more.q.rows());
  state.residual_B.conservativeResize(n, Eigen::NoChange);
  state.residual_B.bottomRows(more.q.rows()) = more.residual_B;
  state.sigma.conservativeResize(n);
  state.sigma.tail(more.q.rows()) = more.sigma;
  if (const Status fine = check(state.q, state.residual_B, state.sigma); !fine)
    return tl::make_unexpected(fine.error());
  if (fitted_->outputs.empty() || median(clipped(state.sigma)) != median(clipped(old.sigma))) return restore(state);

  const VectorXd shape = noise_shape(state.sigma).tail(more.q.rows());
  std::vector<LocalExperts> outputs;
  for (Index d = 0; d < kOutputs; ++d) {
    auto output = fitted_->outputs[static_cast<std::size_t>(d)].with(
        more.q, more.residual_B.col(d).array() - state.offset[d], shape);
    if (!output) return restore(state);
    outputs.push_back(*std::move(output));
  }
  return regrown(std::move(state), std::move(outputs));
}

Result<BiasModel> BiasModel::without(const std::vector<Index>& observations) const {
  const BiasState& old = fitted_->state;
  std::vector<Index> kept;
  auto gone = observations.begin();
  for (Index i = 0; i < old.q.rows(); ++i) {
    if (gone != observations.end() && *gone == i) {
      ++gone;
    } else {
      kept.push_back(i);
    }
  }
  if (gone != observations.end())
    return refused("bias data: observation {} is not one of {} in rising order", *gone, old.q.rows());
  BiasState state = old;
  state.q = old.q(kept, Eigen::all);
  state.residual_B = old.residual_B(kept, Eigen::all);
  state.sigma = old.sigma(kept);
  if (const Status fine = check(state.q, state.residual_B, state.sigma); !fine)
    return tl::make_unexpected(fine.error());
  if (fitted_->outputs.empty() || median(clipped(state.sigma)) != median(clipped(old.sigma))) return restore(state);

  std::vector<LocalExperts> outputs;
  for (const LocalExperts& output : fitted_->outputs) outputs.push_back(output.without(observations));
  return regrown(std::move(state), std::move(outputs));
}

Result<BiasModel> BiasModel::regrown(BiasState state, std::vector<LocalExperts> outputs) const {
  auto fitted = std::make_shared<Fitted>();
  fitted->state = std::move(state);
  fitted->outputs = std::move(outputs);
  fitted->report = report_of(fitted->outputs, fitted->state.residual_B - fitted->leave_one_out_mean_B());
  fitted->report.starts_at_best = fitted_->report.starts_at_best;
  fitted->report.evaluations = fitted_->report.evaluations;
  return BiasModel(std::move(fitted));
}

Vector3 BiasModel::mean_B(const JointVector& q) const { return mean_all_B(q.transpose()).row(0); }

MatrixXd BiasModel::mean_all_B(const MatrixXd& q) const {
  if (fitted_->outputs.empty()) return MatrixXd::Zero(q.rows(), kOutputs);
  MatrixXd mean(q.rows(), kOutputs);
  for (Index d = 0; d < kOutputs; ++d) fitted_->outputs[static_cast<std::size_t>(d)].mean(q, mean.col(d).data());
  return mean.rowwise() + fitted_->state.offset.transpose();
}

BiasPrediction BiasModel::predict(const JointVector& q) const { return predict_all(q.transpose()).front(); }

std::vector<BiasPrediction> BiasModel::predict_all(const MatrixXd& q) const {
  std::vector<BiasPrediction> predictions(static_cast<std::size_t>(q.rows()));
  if (fitted_->outputs.empty()) {
    for (BiasPrediction& prediction : predictions) {
      prediction.stddev_B = fitted_->stddev;
      prediction.measured_stddev_B = fitted_->stddev;
    }
    return predictions;
  }
  for (BiasPrediction& prediction : predictions) prediction.prior_share = 0;
  const MatrixXd mean_B = mean_all_B(q);
  for (Index d = 0; d < kOutputs; ++d) {
    const LocalExperts& output = fitted_->outputs[static_cast<std::size_t>(d)];
    const std::vector<PosteriorVariance> variance = output.variance(q);
    for (std::size_t i = 0; i < predictions.size(); ++i) {
      BiasPrediction& prediction = predictions[i];
      prediction.mean_B[d] = mean_B(static_cast<Index>(i), d);
      prediction.stddev_B[d] = std::sqrt(variance[i].posterior);
      prediction.measured_stddev_B[d] = std::sqrt(variance[i].posterior + output.noise_variance());
      prediction.prior_share = std::max(prediction.prior_share, variance[i].posterior / variance[i].prior);
    }
  }
  return predictions;
}

VectorXd BiasModel::leave_one_out_prior_share() const {
  if (fitted_->outputs.empty()) return VectorXd::Ones(fitted_->state.q.rows());
  VectorXd share = VectorXd::Zero(fitted_->state.q.rows());
  for (const LocalExperts& output : fitted_->outputs) share = share.cwiseMax(output.leave_one_out_share());
  return share;
}

MatrixXd BiasModel::leave_one_out_mean_B() const { return fitted_->leave_one_out_mean_B(); }

MatrixXd BiasModel::leave_one_out_stddev_B() const {
  if (fitted_->outputs.empty()) return fitted_->stddev.transpose().replicate(fitted_->state.q.rows(), 1);
  MatrixXd stddev(fitted_->state.q.rows(), kOutputs);
  for (Index d = 0; d < kOutputs; ++d)
    stddev.col(d) = fitted_->outputs[static_cast<std::size_t>(d)].leave_one_out_variance().cwiseSqrt();
  return stddev;
}

const BiasState& BiasModel::state() const { return fitted_->state; }

const BiasFitReport& BiasModel::report() const { return fitted_->report; }

}  // namespace trammel
