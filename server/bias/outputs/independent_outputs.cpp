#include <algorithm>
#include <cmath>
#include <utility>

#include "server/bias/outputs/bias_outputs.h"
#include "server/bias/process/local_experts.h"

namespace trammel {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kSilence =
    1e-9;  // m rms: a smaller output has nothing to learn, and no scale for a search

// An output that is constant: no signal, the instrument's noise.
GpHyperparameters silent(const VectorXd& kernel, double metrology_stddev) {
  return {kernel, std::log(kSilence), std::log(metrology_stddev)};
}

std::vector<Index> speaking_outputs(const MatrixXd& y, Index first) {
  std::vector<Index> outputs;
  for (Index d = first; d < std::min(first + kOfOneUnit, y.cols()); ++d) {
    if (y.col(d).norm() > kSilence * std::sqrt(static_cast<double>(y.rows()))) outputs.push_back(d);
  }
  return outputs;
}

class IndependentOutputs final : public BiasOutputs {
 public:
  explicit IndependentOutputs(std::vector<LocalExperts> outputs) : outputs_(std::move(outputs)) {}

  MatrixXd mean(const MatrixXd& q, const std::vector<BiasFeatures>& /*features*/) const override {
    MatrixXd mean(q.rows(), count());
    for (Index d = 0; d < count(); ++d) at(d).mean(q, mean.col(d).data());
    return mean;
  }

  std::vector<OutputPrediction> predict(
      const MatrixXd& q, const std::vector<BiasFeatures>& /*features*/) const override {
    VectorXd means(q.rows());
    std::vector<OutputPrediction> predictions(
        static_cast<std::size_t>(q.rows()),
        {VectorXd(count()), MatrixXd::Zero(count(), count()), 0.0});
    for (Index d = 0; d < count(); ++d) {
      const std::vector<PosteriorVariance> variance = at(d).variance(q, means.data());
      for (std::size_t i = 0; i < predictions.size(); ++i) {
        OutputPrediction& prediction = predictions[i];
        prediction.mean[d] = means[static_cast<Index>(i)];
        prediction.covariance(d, d) = variance[i].posterior;
        if (d < kOfOneUnit)
          prediction.prior_share =
              std::max(prediction.prior_share, variance[i].posterior / variance[i].prior);
      }
    }
    return predictions;
  }

  VectorXd noise_variance() const override {
    return of_each([](const LocalExperts& output) { return output.noise_variance(); });
  }
  VectorXd log_likelihood() const override {
    return of_each([](const LocalExperts& output) { return output.log_likelihood(); });
  }
  MatrixXd leave_one_out_mean() const override {
    MatrixXd mean(at(0).size(), count());
    for (Index d = 0; d < count(); ++d) mean.col(d) = at(d).leave_one_out_mean();
    return mean;
  }
  MatrixXd leave_one_out_variance() const override {
    MatrixXd variance(at(0).size(), count());
    for (Index d = 0; d < count(); ++d) variance.col(d) = at(d).leave_one_out_variance();
    return variance;
  }
  VectorXd leave_one_out_share() const override {
    VectorXd share = VectorXd::Zero(at(0).size());
    for (Index d = 0; d < std::min(count(), kOfOneUnit); ++d)
      share = share.cwiseMax(at(d).leave_one_out_share());
    return share;
  }

  std::optional<MatrixXd> left_out_error(const MatrixXd& y,
                                         const std::vector<Index>& points) const override {
    MatrixXd error(static_cast<Index>(points.size()), count());
    for (Index d = 0; d < count(); ++d) {
      const std::optional<VectorXd> output = at(d).left_out_error(y.col(d), points);
      if (!output) return std::nullopt;
      error.col(d) = *output;
    }
    return error;
  }

  BiasOutputsPtr with(const OutputData& more) const override {
    std::vector<LocalExperts> grown;
    for (Index d = 0; d < count(); ++d) {
      auto output = at(d).with(more.q, more.y.col(d), more.noise_shape);
      if (!output) return nullptr;
      grown.push_back(*std::move(output));
    }
    return std::make_shared<IndependentOutputs>(std::move(grown));
  }
  BiasOutputsPtr without(const std::vector<Index>& points) const override {
    std::vector<LocalExperts> rest;
    for (const LocalExperts& output : outputs_) rest.push_back(output.without(points));
    return std::make_shared<IndependentOutputs>(std::move(rest));
  }

 private:
  Index count() const { return static_cast<Index>(outputs_.size()); }
  const LocalExperts& at(Index d) const { return outputs_[static_cast<std::size_t>(d)]; }
  template <typename Figure>
  VectorXd of_each(const Figure& figure) const {
    VectorXd figures(count());
    for (Index d = 0; d < count(); ++d) figures[d] = figure(at(d));
    return figures;
  }

  std::vector<LocalExperts> outputs_;
};

}  // namespace

BiasOutputsPtr condition_independent(const KernelPtr& kernel, const OutputData& data,
                                     const std::vector<GpHyperparameters>& at, VarianceForm form) {
  std::vector<LocalExperts> outputs;
  for (std::size_t d = 0; d < at.size(); ++d) {
    auto output = LocalExperts::condition(kernel, data.q, data.y.col(static_cast<Index>(d)),
                                          data.noise_shape, at[d], form);
    if (!output) return nullptr;
    outputs.push_back(*std::move(output));
  }
  return std::make_shared<IndependentOutputs>(std::move(outputs));
}

std::optional<CoupledSearchResult> search_independent(const KernelPtr& kernel,
                                                      const OutputData& data,
                                                      const VectorXd& metrology_stddev,
                                                      const SearchOptions& options,
                                                      const CoupledHyperparameters* last) {
  const SearchBox box = kernel->search_box(data.q);
  CoupledSearchResult result;
  for (Index d = 0; d < data.y.cols(); ++d)
    result.found.outputs.push_back(silent(0.5 * (box.low + box.high), metrology_stddev[d]));
  const auto units = static_cast<double>((data.y.cols() + kOfOneUnit - 1) / kOfOneUnit);
  for (Index first = 0; first < data.y.cols(); first += kOfOneUnit) {
    const std::vector<Index> speaking = speaking_outputs(data.y, first);
    if (speaking.empty()) continue;
    SearchOptions search = options;
    if (options.progress) {
      const double done = static_cast<double>(first / kOfOneUnit) / units;
      search.progress = [&options, done, units](double share) {
        return options.progress(done + share / units);
      };
    }
    if (last != nullptr) {
      for (const Index d : speaking)
        search.last.push_back(last->outputs[static_cast<std::size_t>(d)]);
    }
    auto found =
        search_hyperparameters(kernel, {data.q, data.y(Eigen::all, speaking), data.noise_shape},
                               metrology_stddev[first], search);
    if (!found) return std::nullopt;
    for (std::size_t i = 0; i < found->outputs.size(); ++i)
      result.found.outputs[static_cast<std::size_t>(speaking[i])] = found->outputs[i];
    if (first == 0) result.starts_at_best = found->starts_at_best;
    result.evaluations += found->evaluations;
    result.given_up = found->given_up;
    if (result.given_up) break;
  }
  return result;
}

}  // namespace trammel
