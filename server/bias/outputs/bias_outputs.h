#pragma once

#include <Eigen/Dense>
#include <memory>
#include <optional>
#include <vector>

#include "server/bias/coupled/coupled_search.h"
#include "server/bias/kernels/kernel_spelling.h"

/// The outputs that a BiasModel predicts with: D silent, independent, coupled by blocks, or
/// seen at the flange.
namespace trammel {

/// Outputs that share a unit: the coordinates of a position, or of a rotation.
inline constexpr Eigen::Index kOfOneUnit = 3;

/// The data that outputs learn from.
struct OutputData {
  Eigen::MatrixXd q;                   ///< N x n, rad
  Eigen::MatrixXd y;                   ///< N x D, offset removed
  Eigen::VectorXd noise_shape;         ///< N, noise variance of each point relative to σ_n²
  std::vector<BiasFeatures> features;  ///< N; empty without blocks
};

/// At one joint vector.
struct OutputPrediction {
  Eigen::VectorXd mean;        ///< D
  Eigen::MatrixXd covariance;  ///< D x D, of the functions themselves
  double prior_share = 0;      ///< of the first three outputs, as in BiasPrediction
  Eigen::VectorXd nearby =
      {};  ///< D: the part of the mean that the kernel predicts; empty without blocks
};

/// D outputs conditioned on their data. Immutable, thread-safe. `features`: one for each joint
/// vector; empty without blocks.
class BiasOutputs {
 public:
  virtual ~BiasOutputs() = default;

  /// M x D.
  [[nodiscard]] virtual Eigen::MatrixXd mean(const Eigen::MatrixXd& q,
                                             const std::vector<BiasFeatures>& features) const = 0;
  [[nodiscard]] virtual std::vector<OutputPrediction> predict(
      const Eigen::MatrixXd& q, const std::vector<BiasFeatures>& features) const = 0;
  /// M x D: the part of the mean that the kernel predicts; all of it without blocks.
  [[nodiscard]] virtual Eigen::MatrixXd nearby_mean(const Eigen::MatrixXd& q) const {
    return mean(q, {});
  }
  /// P: weights of the block `parameters`; empty without that block.
  [[nodiscard]] virtual Eigen::VectorXd parameter_weights() const { return {}; }
  /// D, of one measurement.
  [[nodiscard]] virtual Eigen::VectorXd noise_variance() const = 0;
  /// Nat: of each output, or one number for coupled outputs.
  [[nodiscard]] virtual Eigen::VectorXd log_likelihood() const = 0;
  /// Every training pose predicted from all the others. N x D: mean, and variance of the
  /// measurement. N: prior share, as in BiasModel.
  [[nodiscard]] virtual Eigen::MatrixXd leave_one_out_mean() const = 0;
  [[nodiscard]] virtual Eigen::MatrixXd leave_one_out_variance() const = 0;
  [[nodiscard]] virtual Eigen::VectorXd leave_one_out_share() const = 0;

  /// The error of `y` (N x D, in place of the observations) at these points when they are predicted
  /// from all others. Empty if that needs a new conditioning.
  [[nodiscard]] virtual std::optional<Eigen::MatrixXd> left_out_error(
      const Eigen::MatrixXd& /*y*/, const std::vector<Eigen::Index>& /*points*/) const {
    return std::nullopt;
  }

  /// With more points, or without some (rising indices); null where the outputs must be conditioned
  /// anew.
  [[nodiscard]] virtual std::shared_ptr<const BiasOutputs> with(const OutputData& /*more*/) const {
    return nullptr;
  }
  [[nodiscard]] virtual std::shared_ptr<const BiasOutputs> without(
      const std::vector<Eigen::Index>& /*points*/) const {
    return nullptr;
  }
};

using BiasOutputsPtr = std::shared_ptr<const BiasOutputs>;

/// Predicts zero, with the rms of `residual` (N x D) as its stddev.
[[nodiscard]] BiasOutputsPtr make_silent_outputs(const Eigen::MatrixXd& residual);

/// Independent outputs. Null when a covariance is not positive definite.
[[nodiscard]] BiasOutputsPtr condition_independent(const KernelPtr& kernel, const OutputData& data,
                                                   const std::vector<GpHyperparameters>& at,
                                                   VarianceForm form);
/// The most probable hyperparameters of independent outputs; outputs of another unit (from the
/// fourth on) are searched separately. `metrology_stddev`: D, the instrument's. If `last` is given,
/// there are no other starts. Empty if no start gave a positive definite covariance.
[[nodiscard]] std::optional<CoupledSearchResult> search_independent(
    const KernelPtr& kernel, const OutputData& data, const Eigen::VectorXd& metrology_stddev,
    const SearchOptions& options, const CoupledHyperparameters* last);

/// Outputs that share the weights of blocks. Null when a covariance is not positive definite.
[[nodiscard]] BiasOutputsPtr condition_coupled(const SpelledBias& bias, const OutputData& data,
                                               const CoupledHyperparameters& at, VarianceForm form);
[[nodiscard]] std::optional<CoupledSearchResult> search_coupled_outputs(
    const SpelledBias& bias, const OutputData& data, const Eigen::VectorXd& metrology_stddev,
    const SearchOptions& options, const CoupledHyperparameters* last);

/// Outputs that are the error of the flange, seen through the levers of `features`. Of the kernel
/// alone. Null when the covariance is not positive definite.
[[nodiscard]] BiasOutputsPtr condition_flange(const KernelPtr& kernel, const OutputData& data,
                                              const CoupledHyperparameters& at);
[[nodiscard]] std::optional<CoupledSearchResult> search_flange_outputs(
    const KernelPtr& kernel, const OutputData& data, const Eigen::VectorXd& metrology_stddev,
    const SearchOptions& options, const CoupledHyperparameters* last);

}  // namespace trammel
