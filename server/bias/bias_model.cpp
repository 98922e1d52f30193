#include "server/bias/bias_model.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "server/bias/bias_checks.h"
#include "server/bias/kernels/joint_map_block.h"
#include "server/bias/outputs/bias_outputs.h"

namespace trammel {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kSmallestSigma =
    1e-7;  // m: no tracker knows a point better, whatever its file says
constexpr double kMostNoiseRatio =
    4.0;  // of variances: no point may dominate by claiming a sigma of 2 µm
constexpr std::string_view kNone = "none";

double median(VectorXd values) {
  const Index middle = values.size() / 2;
  std::nth_element(values.data(), values.data() + middle, values.data() + values.size());
  return values[middle];
}

VectorXd clipped(const VectorXd& sigma) { return sigma.cwiseMax(kSmallestSigma); }

// Noise variance of each point relative to the learned one: as the instrument says, within reason.
VectorXd noise_shape(const VectorXd& sigma) {
  const VectorXd ratio = (clipped(sigma) / median(clipped(sigma))).cwiseAbs2();
  return ratio.cwiseMax(1.0 / kMostNoiseRatio).cwiseMin(kMostNoiseRatio);
}

// As BiasState has them: a column for each coordinate; rows kernel, log σ_f, log σ_n.
MatrixXd as_columns(const std::vector<GpHyperparameters>& outputs) {
  MatrixXd columns(outputs.front().kernel.size() + 2, static_cast<Index>(outputs.size()));
  for (std::size_t d = 0; d < outputs.size(); ++d)
    columns.col(static_cast<Index>(d)) << outputs[d].kernel, outputs[d].log_signal_stddev,
        outputs[d].log_noise_stddev;
  return columns;
}

CoupledHyperparameters hyperparameters_of(const BiasState& state) {
  CoupledHyperparameters at;
  const Index count = state.hyperparameters.rows() - 2;
  for (const auto& column : state.hyperparameters.colwise())
    at.outputs.push_back({column.head(count), column[count], column[count + 1]});
  at.blocks = state.block_hyperparameters;
  return at;
}

OutputData data_of(const BiasState& state) {
  return {state.q, state.residual_B.rowwise() - state.offset.transpose(), noise_shape(state.sigma),
          state.features};
}

Status check_described(const SpelledBias& bias, const BiasState& state) {
  if (!bias.needs_features()) return {};
  return check_features(state.kernel, state.features, state.q.rows()).and_then([&]() -> Status {
    if (!bias.flange) return {};
    return check_flange(state.q, state.features);
  });
}

/// The bias with the maps of the state.
SpelledBias as_stored(SpelledBias bias, const BiasState& state) {
  if (bias.blocks.empty()) return bias;
  const auto harmonics =
      harmonics_in(state.block_hyperparameters, state.features.front().by_joint.cols());
  return harmonics ? with_harmonics(std::move(bias), *harmonics, *harmonics) : bias;
}

/// The bias with as many harmonics in its maps as the observations can determine.
SpelledBias for_observations(SpelledBias bias, Index count) {
  return with_harmonics(std::move(bias), harmonics_for(count), harmonics_for(count));
}

BiasOutputsPtr conditioned(const SpelledBias& bias, const OutputData& data,
                           const CoupledHyperparameters& at, VarianceForm form) {
  if (bias.flange) return condition_flange(bias.kernel, data, at);
  if (!bias.blocks.empty()) return condition_coupled(bias, data, at, form);
  return condition_independent(bias.kernel, data, at.outputs, form);
}

std::optional<CoupledSearchResult> searched(const SpelledBias& bias, const OutputData& data,
                                            const VectorXd& metrology_stddev,
                                            const SearchOptions& options,
                                            const CoupledHyperparameters* last) {
  if (bias.flange) return search_flange_outputs(bias.kernel, data, metrology_stddev, options, last);
  if (!bias.blocks.empty())
    return search_coupled_outputs(bias, data, metrology_stddev, options, last);
  return search_independent(bias.kernel, data, metrology_stddev, options, last);
}

double row_rms(const MatrixXd& rows) {
  return std::sqrt(rows.squaredNorm() / static_cast<double>(rows.rows()));
}

}  // namespace

struct BiasModel::Fitted {
  BiasState state;
  BiasFitReport report;
  bool coupled = false;    // has blocks
  bool described = false;  // needs features
  BiasOutputsPtr outputs;
  double mean_noise_shape =
      1;  // noise variance of an average measurement, relative to the learned one

  Fitted(BiasState of, bool with_blocks, bool with_features, BiasOutputsPtr conditioned)
      : state(std::move(of)),
        coupled(with_blocks),
        described(with_features),
        outputs(std::move(conditioned)) {
    mean_noise_shape = noise_shape(state.sigma).mean();
    report.log_likelihood = outputs->log_likelihood();
    report.noise_stddev = outputs->noise_variance().cwiseSqrt();
    report.leave_one_out_rms = row_rms(state.residual_B - leave_one_out_mean_B());
  }
  MatrixXd leave_one_out_mean_B() const {
    return outputs->leave_one_out_mean().rowwise() + state.offset.transpose();
  }

  static Result<std::shared_ptr<Fitted>> from(const BiasState& state, VarianceForm form);
};

Result<std::shared_ptr<BiasModel::Fitted>> BiasModel::Fitted::from(const BiasState& state,
                                                                   VarianceForm form) {
  TRY(check_observations(state.q, state.residual_B, state.sigma));
  if (state.kernel == kNone) {
    BiasState silent = state;
    silent.offset = VectorXd::Zero(kCoordinates);
    return std::make_shared<Fitted>(std::move(silent), false, false,
                                    make_silent_outputs(state.residual_B));
  }
  auto bias = spelled_bias(state.kernel);
  if (!bias) return tl::make_unexpected(bias.error());
  TRY(check_described(*bias, state));
  bias = as_stored(*std::move(bias), state);
  TRY(check_hyperparameters(state, *bias));
  const CoupledHyperparameters at = hyperparameters_of(state);
  const OutputData data = data_of(state);
  BiasOutputsPtr outputs = conditioned(*bias, data, at, form);
  if (!outputs)
    return refused("bias: the covariance of {} observations is not positive definite",
                   state.q.rows());
  return std::make_shared<Fitted>(state, !bias->blocks.empty(), bias->needs_features(),
                                  std::move(outputs));
}

Result<BiasModel> BiasModel::restore(const BiasState& state) {
  return Fitted::from(state, VarianceForm::kServed).map([](std::shared_ptr<Fitted> fitted) {
    return BiasModel(std::move(fitted));
  });
}

Result<BiasModel> BiasModel::fit(const BiasProblem& problem, const BiasOptions& options) {
  return fit_from(problem, options, nullptr);
}

Result<BiasModel> BiasModel::refit(const BiasOptions& options) const {
  const BiasState& state = fitted_->state;
  BiasOptions same_kernel = options;
  same_kernel.kernel = state.kernel;
  return fit_from({state.q, state.residual_B, state.sigma, state.features}, same_kernel, &state);
}

Result<BiasModel> BiasModel::fit_from(const BiasProblem& problem, const BiasOptions& options,
                                      const BiasState* last) {
  TRY(check_observations(problem.q, problem.residual_B, problem.sigma));
  BiasState state{options.kernel,
                  problem.q,
                  problem.residual_B,
                  problem.sigma,
                  VectorXd::Zero(kCoordinates),
                  {}};
  if (options.kernel == kNone) return restore(state);
  auto bias = spelled_bias(options.kernel);
  if (!bias) return tl::make_unexpected(bias.error());
  if (options.starts < 1)
    return refused("bias fit: {} starts, at least 1", options.starts)
        .of("starts")
        .beyond(options.starts, 1);
  if (bias->needs_features()) state.features = problem.features;
  TRY(check_described(*bias, state));
  bias = last != nullptr ? as_stored(*std::move(bias), *last)
                         : for_observations(*std::move(bias), problem.q.rows());

  state.offset = problem.residual_B.colwise().mean().transpose();
  const OutputData data = data_of(state);
  const VectorXd metrology_stddev =
      VectorXd::Constant(kCoordinates, median(clipped(problem.sigma)));
  const SearchOptions search{options.starts, options.seed, options.progress, {}};
  std::optional<CoupledHyperparameters> from;
  if (last != nullptr) from = hyperparameters_of(*last);
  const CoupledHyperparameters* start = from ? &*from : nullptr;
  const auto found = searched(*bias, data, metrology_stddev, search, start);
  if (!found)
    return refused(
        "bias fit: no start of {} gave a positive definite covariance of {} observations",
        options.starts, problem.q.rows());
  if (found->given_up) return failure(ErrorCode::kBusy, "bias fit: given up on request");
  state.hyperparameters = as_columns(found->found.outputs);
  state.block_hyperparameters = found->found.blocks;

  // Conditions the model in the same way as a stored one, so that a restored model is equal.
  const auto fitted = TRY(Fitted::from(state, VarianceForm::kLearned));
  fitted->report.starts_at_best = found->starts_at_best;
  fitted->report.evaluations = found->evaluations;
  return BiasModel(fitted);
}

Result<BiasModel> BiasModel::with(const BiasProblem& more) const {
  const BiasState& old = fitted_->state;
  if (more.q.cols() != old.q.cols())
    return refused("{} joints, the model has {}", more.q.cols(), old.q.cols())
        .in("bias data")
        .beyond(more.q.cols(), old.q.cols());
  const Index n = old.q.rows() + more.q.rows();
  BiasState state = old;
  state.q.conservativeResize(n, Eigen::NoChange);
  state.q.bottomRows(more.q.rows()) = more.q;
  if (more.residual_B.rows() != more.q.rows() || more.residual_B.cols() != kCoordinates ||
      more.sigma.size() != more.q.rows())
    return refused("residual or sigma does not have {} rows", more.q.rows())
        .in("bias data")
        .of("residual")
        .beyond(more.residual_B.rows(), more.q.rows());
  state.residual_B.conservativeResize(n, Eigen::NoChange);
  state.residual_B.bottomRows(more.q.rows()) = more.residual_B;
  state.sigma.conservativeResize(n);
  state.sigma.tail(more.q.rows()) = more.sigma;
  state.features.insert(state.features.end(), more.features.begin(), more.features.end());
  TRY(check_observations(state.q, state.residual_B, state.sigma));
  if (median(clipped(state.sigma)) != median(clipped(old.sigma))) return restore(state);

  const VectorXd shape = noise_shape(state.sigma).tail(more.q.rows());
  return regrown(std::move(state),
                 fitted_->outputs->with({more.q, more.residual_B.rowwise() - old.offset.transpose(),
                                         shape, more.features}));
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
    return refused("observation {} is not one of {} in rising order", *gone, old.q.rows())
        .in("bias data")
        .of("observation")
        .beyond(*gone, old.q.rows());
  BiasState state = old;
  state.q = old.q(kept, Eigen::all);
  state.residual_B = old.residual_B(kept, Eigen::all);
  state.sigma = old.sigma(kept);
  if (!old.features.empty()) {
    state.features.clear();
    for (const Index i : kept) state.features.push_back(old.features[static_cast<std::size_t>(i)]);
  }
  TRY(check_observations(state.q, state.residual_B, state.sigma));
  if (median(clipped(state.sigma)) != median(clipped(old.sigma))) return restore(state);
  return regrown(std::move(state), fitted_->outputs->without(observations));
}

Result<BiasModel> BiasModel::regrown(BiasState state, BiasOutputsPtr outputs) const {
  if (!outputs) return restore(state);
  auto fitted = std::make_shared<Fitted>(std::move(state), fitted_->coupled, fitted_->described,
                                         std::move(outputs));
  fitted->report.starts_at_best = fitted_->report.starts_at_best;
  fitted->report.evaluations = fitted_->report.evaluations;
  return BiasModel(std::move(fitted));
}

bool BiasModel::needs_features() const { return fitted_->described; }

bool BiasModel::has_blocks() const { return fitted_->coupled; }

Vector3 BiasModel::mean_B(const JointVector& q, const BiasFeatures& features) const {
  if (!fitted_->described) return mean_all_B(q.transpose()).row(0);
  return mean_all_B(q.transpose(), {features}).row(0);
}

MatrixXd BiasModel::mean_all_B(const MatrixXd& q, const std::vector<BiasFeatures>& features) const {
  return fitted_->outputs->mean(q, features).rowwise() + fitted_->state.offset.transpose();
}

VectorXd BiasModel::parameter_weights() const { return fitted_->outputs->parameter_weights(); }

MatrixXd BiasModel::nearby_mean_all_B(const MatrixXd& q) const {
  if (fitted_->coupled) return fitted_->outputs->nearby_mean(q);
  return mean_all_B(q);
}

BiasPrediction BiasModel::predict(const JointVector& q, const BiasFeatures& features) const {
  if (!fitted_->described) return predict_all(q.transpose()).front();
  return predict_all(q.transpose(), {features}).front();
}

std::vector<BiasPrediction> BiasModel::predict_all(
    const MatrixXd& q, const std::vector<BiasFeatures>& features) const {
  std::vector<BiasPrediction> predictions;
  const Vector3 noise = fitted_->mean_noise_shape * fitted_->outputs->noise_variance();
  for (const OutputPrediction& at : fitted_->outputs->predict(q, features)) {
    BiasPrediction prediction;
    prediction.mean_B = at.mean + fitted_->state.offset;
    prediction.nearby_B = fitted_->coupled ? Vector3(at.nearby) : prediction.mean_B;
    prediction.covariance_B = at.covariance;
    prediction.stddev_B = prediction.covariance_B.diagonal().cwiseSqrt();
    prediction.measured_stddev_B = (prediction.covariance_B.diagonal() + noise).cwiseSqrt();
    prediction.prior_share = at.prior_share;
    predictions.push_back(prediction);
  }
  return predictions;
}

VectorXd BiasModel::leave_one_out_prior_share() const {
  return fitted_->outputs->leave_one_out_share();
}

MatrixXd BiasModel::leave_one_out_mean_B() const { return fitted_->leave_one_out_mean_B(); }

MatrixXd BiasModel::leave_one_out_stddev_B() const {
  return fitted_->outputs->leave_one_out_variance().cwiseSqrt();
}

std::optional<MatrixXd> BiasModel::left_out_error_B(const MatrixXd& residual_B,
                                                    const std::vector<Index>& observations) const {
  return fitted_->outputs->left_out_error(residual_B.rowwise() - fitted_->state.offset.transpose(),
                                          observations);
}

const BiasState& BiasModel::state() const { return fitted_->state; }

const BiasFitReport& BiasModel::report() const { return fitted_->report; }

}  // namespace trammel
