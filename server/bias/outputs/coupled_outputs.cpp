#include <algorithm>
#include <cmath>
#include <utility>

#include "server/base/check.h"
#include "server/bias/coupled/coupled_posterior.h"
#include "server/bias/kernels/joint_map_block.h"
#include "server/bias/outputs/bias_outputs.h"

namespace trammel {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index kPosesAtATime = 256;  // their columns of H are a few megabytes

// H of each output at `many` poses from `first` on, `many` x p, not scaled.
std::vector<MatrixXd> columns_of(const LinearBlocks& blocks, const MatrixXd& q,
                                 const std::vector<BiasFeatures>& features, Index first, Index many,
                                 Index outputs) {
  TRAMMEL_CHECK(static_cast<Index>(features.size()) == q.rows());
  std::vector<MatrixXd> columns(static_cast<std::size_t>(outputs),
                                MatrixXd(many, blocks.column_count()));
  for (Index i = 0; i < many; ++i) {
    const MatrixXd H =
        blocks.columns(q.row(first + i).transpose(), features[static_cast<std::size_t>(first + i)]);
    for (Index d = 0; d < outputs; ++d) columns[static_cast<std::size_t>(d)].row(i) = H.row(d);
  }
  return columns;
}

LinearBlocks blocks_of(const SpelledBias& bias, const OutputData& data) {
  return {bias.blocks, data.features.front()};
}

/// blocks_of() with only the harmonics that few points determine; empty if there are no others.
std::optional<LinearBlocks> coarse_blocks(const SpelledBias& bias, const LinearBlocks& blocks,
                                          const OutputData& data) {
  const Index joints = data.features.front().by_joint.cols();
  const auto harmonics =
      bias.has("joint_map") ? harmonics_in(blocks.start(), joints) : std::nullopt;
  if (!harmonics || *harmonics <= harmonics_for(0)) return std::nullopt;
  return blocks_of(with_harmonics(bias, harmonics_for(0), *harmonics), data);
}

CoupledData coupled(const LinearBlocks& blocks, const OutputData& data) {
  return {data.q, data.y, data.noise_shape,
          columns_of(blocks, data.q, data.features, 0, data.q.rows(), data.y.cols())};
}

// Coupled outputs with variances widened by cross-validation. Many hyperparameters, and the drift
// of a measuring session, make the process too certain.
class CoupledOutputs final : public BiasOutputs {
 public:
  CoupledOutputs(LinearBlocks blocks, CoupledPosterior posterior, const CoupledHyperparameters& at,
                 const VectorXd& noise_shape, VectorXd parameter_weights)
      : blocks_(std::move(blocks)),
        posterior_(std::move(posterior)),
        noise_shape_(noise_shape),
        parameter_weights_(std::move(parameter_weights)),
        widening_(std::max(1.0, posterior_.surprise())) {
    noise_variance_.resize(static_cast<Index>(at.outputs.size()));
    for (Index d = 0; d < count(); ++d)
      noise_variance_[d] =
          widening_ * std::exp(2 * at.outputs[static_cast<std::size_t>(d)].log_noise_stddev);
  }

  MatrixXd mean(const MatrixXd& q, const std::vector<BiasFeatures>& features) const override {
    TRAMMEL_CHECK(static_cast<Index>(features.size()) == q.rows());
    MatrixXd mean = posterior_.own_mean(q);
    for (Index i = 0; i < q.rows(); ++i) {
      const MatrixXd H =
          blocks_.columns(q.row(i).transpose(), features[static_cast<std::size_t>(i)]);
      for (Index d = 0; d < count(); ++d) mean(i, d) += H.row(d).dot(posterior_.weights());
    }
    return mean;
  }

  std::vector<OutputPrediction> predict(const MatrixXd& q,
                                        const std::vector<BiasFeatures>& features) const override {
    std::vector<OutputPrediction> predictions;
    for (Index first = 0; first < q.rows(); first += kPosesAtATime) {
      const Index many = std::min(kPosesAtATime, q.rows() - first);
      for (CoupledPrediction& at : posterior_.predict(
               q.middleRows(first, many), columns_of(blocks_, q, features, first, many, count()))) {
        const double share = share_of(at.covariance.diagonal(), at.prior);
        predictions.push_back(
            {std::move(at.mean), widening_ * at.covariance, share, std::move(at.own_mean)});
      }
    }
    return predictions;
  }

  MatrixXd nearby_mean(const MatrixXd& q) const override { return posterior_.own_mean(q); }

  VectorXd parameter_weights() const override { return parameter_weights_; }
  VectorXd noise_variance() const override { return noise_variance_; }
  VectorXd log_likelihood() const override {
    return VectorXd::Constant(1, posterior_.log_likelihood());
  }
  MatrixXd leave_one_out_mean() const override { return posterior_.leave_one_out_mean(); }
  MatrixXd leave_one_out_variance() const override {
    return widening_ * posterior_.leave_one_out_variance();
  }
  VectorXd leave_one_out_share() const override {
    const MatrixXd& variance = posterior_.leave_one_out_variance();
    VectorXd share(variance.rows());
    for (Index i = 0; i < share.size(); ++i) {
      const VectorXd known =
          variance.row(i).transpose() - noise_shape_[i] / widening_ * noise_variance_;
      share[i] = share_of(known, posterior_.prior().row(i).transpose());
    }
    return share;
  }

 private:
  Index count() const { return noise_variance_.size(); }
  static double share_of(const VectorXd& known, const VectorXd& prior) {
    return known.cwiseQuotient(prior).head(kOfOneUnit).cwiseMax(0.0).cwiseMin(1.0).maxCoeff();
  }

  LinearBlocks blocks_;
  CoupledPosterior posterior_;
  VectorXd noise_shape_;
  VectorXd parameter_weights_;
  double widening_;  // factor of all variances
  VectorXd noise_variance_;
};

}  // namespace

BiasOutputsPtr condition_coupled(const SpelledBias& bias, const OutputData& data,
                                 const CoupledHyperparameters& at, VarianceForm form) {
  LinearBlocks blocks = blocks_of(bias, data);
  auto posterior =
      CoupledPosterior::condition(bias.kernel, blocks, coupled(blocks, data), at, form);
  if (!posterior) return nullptr;
  VectorXd parameter_weights;
  Index first = 0;
  for (const LinearBlockPtr& block : bias.blocks) {
    const Index count = block->column_count(data.features.front());
    if (block->name() == "parameters")
      parameter_weights = posterior->weights().segment(first, count);
    first += count;
  }
  return std::make_shared<CoupledOutputs>(std::move(blocks), *std::move(posterior), at,
                                          data.noise_shape, std::move(parameter_weights));
}

std::optional<CoupledSearchResult> search_coupled_outputs(const SpelledBias& bias,
                                                          const OutputData& data,
                                                          const VectorXd& metrology_stddev,
                                                          const SearchOptions& options,
                                                          const CoupledHyperparameters* last) {
  const LinearBlocks blocks = blocks_of(bias, data);
  const CoupledData all = coupled(blocks, data);
  const std::optional<LinearBlocks> fewer = coarse_blocks(bias, blocks, data);
  if (!fewer)
    return search_coupled(bias.kernel, {blocks, all}, {blocks, all}, metrology_stddev, false,
                          options, last);
  return search_coupled(bias.kernel, {blocks, all}, {*fewer, coupled(*fewer, data)},
                        metrology_stddev, false, options, last);
}

}  // namespace trammel
