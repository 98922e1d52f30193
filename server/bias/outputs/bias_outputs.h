#pragma once

#include <Eigen/Dense>
#include <memory>
#include <optional>
#include <vector>

#include "server/bias/coupled/coupled_search.h"
#include "server/bias/kernels/kernel_spelling.h"

/// What stands behind a BiasModel: D outputs that know nothing, something each by itself, or something together.
namespace trammel {

/// What outputs learn from.
struct OutputData {
  Eigen::MatrixXd q;                   ///< N x n, rad
  Eigen::MatrixXd y;                   ///< N x D, offset removed
  Eigen::VectorXd noise_shape;         ///< N, noise variance of each point relative to σ_n²
  std::vector<BiasFeatures> features;  ///< N, or none where no block asks for them
};

/// At one joint vector.
struct OutputPrediction {
  Eigen::VectorXd mean;         ///< D
  Eigen::MatrixXd covariance;   ///< D x D, of the functions themselves
  double prior_share = 0;       ///< as BiasPrediction says, of the first three outputs
  Eigen::VectorXd nearby = {};  ///< D: what of the mean the kernel says; empty without blocks: all of it
};

/// D outputs conditioned on their data. Immutable, thread-safe. `features` are as many as joint vectors or, where no
/// block asks for them, none.
class BiasOutputs {
 public:
  virtual ~BiasOutputs() = default;

  /// M x D.
  [[nodiscard]] virtual Eigen::MatrixXd mean(const Eigen::MatrixXd& q,
                                             const std::vector<BiasFeatures>& features) const = 0;
  [[nodiscard]] virtual std::vector<OutputPrediction> predict(const Eigen::MatrixXd& q,
                                                              const std::vector<BiasFeatures>& features) const = 0;
  /// M x D: what of the mean the kernel says, without blocks all of it.
  [[nodiscard]] virtual Eigen::MatrixXd nearby_mean(const Eigen::MatrixXd& q) const { return mean(q, {}); }
  /// P: of the block `parameters`, what the data say of its weights; empty without.
  [[nodiscard]] virtual Eigen::VectorXd parameter_weights() const { return {}; }
  /// D, of one measurement.
  [[nodiscard]] virtual Eigen::VectorXd noise_variance() const = 0;
  /// Nat: of each output, or one number where they have one likelihood together.
  [[nodiscard]] virtual Eigen::VectorXd log_likelihood() const = 0;
  /// N x D: mean of every training pose from all the others, and variance of its measurement; N: share as BiasModel.
  [[nodiscard]] virtual Eigen::MatrixXd leave_one_out_mean() const = 0;
  [[nodiscard]] virtual Eigen::MatrixXd leave_one_out_variance() const = 0;
  [[nodiscard]] virtual Eigen::VectorXd leave_one_out_share() const = 0;

  /// What of `y` (N x D, instead of the observations) these points miss by when they are predicted from all others;
  /// empty where only conditioning anew says it.
  [[nodiscard]] virtual std::optional<Eigen::MatrixXd> left_out_error(
      const Eigen::MatrixXd& /*y*/, const std::vector<Eigen::Index>& /*points*/) const {
    return std::nullopt;
  }

  /// With more points, or without some (rising indices); null where only conditioning anew does it.
  [[nodiscard]] virtual std::shared_ptr<const BiasOutputs> with(const OutputData& /*more*/) const { return nullptr; }
  [[nodiscard]] virtual std::shared_ptr<const BiasOutputs> without(const std::vector<Eigen::Index>& /*points*/) const {
    return nullptr;
  }
};

using BiasOutputsPtr = std::shared_ptr<const BiasOutputs>;

/// Predicts zero, with the rms of `residual` (N x D) as its stddev.
[[nodiscard]] BiasOutputsPtr make_silent_outputs(const Eigen::MatrixXd& residual);

/// Each output by itself. Null when a covariance is not positive definite.
[[nodiscard]] BiasOutputsPtr condition_independent(const KernelPtr& kernel, const OutputData& data,
                                                   const std::vector<GpHyperparameters>& at);
/// Most probable hyperparameters; outputs from the fourth on are of another unit and searched by themselves.
/// `metrology_stddev`: D. From `last`, where given, without new starts. Empty when no start gave a positive definite
/// covariance.
[[nodiscard]] std::optional<CoupledSearchResult> search_independent(const KernelPtr& kernel, const OutputData& data,
                                                                    const Eigen::VectorXd& metrology_stddev,
                                                                    const SearchOptions& options,
                                                                    const CoupledHyperparameters* last);

/// Outputs that share the weights of blocks. Null when a covariance is not positive definite.
[[nodiscard]] BiasOutputsPtr condition_coupled(const SpelledBias& bias, const OutputData& data,
                                               const CoupledHyperparameters& at);
[[nodiscard]] std::optional<CoupledSearchResult> search_coupled_outputs(const SpelledBias& bias, const OutputData& data,
                                                                        const Eigen::VectorXd& metrology_stddev,
                                                                        const SearchOptions& options,
                                                                        const CoupledHyperparameters* last);

}  // namespace trammel
