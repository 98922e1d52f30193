#pragma once

#include <Eigen/Dense>
#include <memory>
#include <optional>
#include <vector>

#include "server/base/result.h"
#include "server/bias/bias_data.h"

/// The learned residual of the physics: joints in, residual of the tool position with its
/// uncertainty out.
namespace trammel {

class BiasOutputs;

/// A fitted Gaussian process for each coordinate (source section 3.4, eqs. 3.15-3.26). If the
/// kernel has blocks (kernel_spelling.h), the coordinates share the weights of the blocks, and each
/// prediction needs the features of its pose. An immutable value; copies share their tables.
/// Thread-safe.
class BiasModel {
 public:
  /// Fits kernel and noise to the observations. The same problem, options and build of numerics.h
  /// give the same model, bit for bit. The kernel `none` predicts zero, with the rms of the
  /// residual as its standard deviation. Observation i has the noise variance σ_n² sigma_i² /
  /// median(sigma²), the ratio kept within [1/4, 4]. σ_n is learned for each coordinate; a weak
  /// prior disfavours values below the instrument's. Refuses fewer than 10 observations, numbers
  /// that are not finite, and an invalid kernel; for a kernel with blocks also more than 4000
  /// observations and missing features. kBusy if `progress` gives up.
  [[nodiscard]] static Result<BiasModel> fit(const BiasProblem& problem,
                                             const BiasOptions& options);
  /// The model of a state. It predicts bit for bit as before on processors that run the same build
  /// of numerics.h; the last bits differ between AVX2 and AVX-512. Refuses the same as fit(), and
  /// hyperparameters of the wrong shape.
  [[nodiscard]] static Result<BiasModel> restore(const BiasState& state);

  /// The model with more observations and unchanged hyperparameters. Costs N² operations for each
  /// if the kernel has no blocks and the median sigma stays, otherwise N³. Equal, up to rounding,
  /// to restoring the longer state. Refuses the same as fit().
  [[nodiscard]] Result<BiasModel> with(const BiasProblem& more) const;
  /// The model without these observations (rising indices), at the same cost. Refuses to keep fewer
  /// than 10.
  [[nodiscard]] Result<BiasModel> without(const std::vector<Eigen::Index>& observations) const;
  /// Fitted again to its own observations, starting where the last fit ended: a few evaluations, no
  /// new starts.
  [[nodiscard]] Result<BiasModel> refit(const BiasOptions& options) const;

  /// True if the kernel has blocks or is at the flange. Only then features are needed; otherwise
  /// they are ignored.
  [[nodiscard]] bool needs_features() const;
  /// True if the kernel has blocks: parts that do not fade with the distance from the training
  /// poses.
  [[nodiscard]] bool has_blocks() const;
  [[nodiscard]] BiasPrediction predict(const JointVector& q,
                                       const BiasFeatures& features = {}) const;
  /// The mean alone, which is much cheaper, for the iteration of a correction.
  [[nodiscard]] Vector3 mean_B(const JointVector& q, const BiasFeatures& features = {}) const;
  /// M x 3, m: BiasPrediction::nearby_B alone; rows of `q` are joint vectors. Do not call it for a
  /// kernel of the flange, whose whole mean is nearby.
  [[nodiscard]] Eigen::MatrixXd nearby_mean_all_B(const Eigen::MatrixXd& q) const;
  /// P: the value of each parameter in the block `parameters`, in prior standard deviations; empty
  /// without that block.
  [[nodiscard]] Eigen::VectorXd parameter_weights() const;
  /// M x 3, m: the means alone of many; rows of `q` are joint vectors.
  [[nodiscard]] Eigen::MatrixXd mean_all_B(const Eigen::MatrixXd& q,
                                           const std::vector<BiasFeatures>& features = {}) const;
  /// Many at once; rows of `q` are joint vectors.
  [[nodiscard]] std::vector<BiasPrediction> predict_all(
      const Eigen::MatrixXd& q, const std::vector<BiasFeatures>& features = {}) const;

  /// N, in [0, 1]: `prior_share` of every training row with its joint vector left out. A target
  /// with a share above the 99 % quantile of these is farther from the data than the data are from
  /// each other.
  [[nodiscard]] Eigen::VectorXd leave_one_out_prior_share() const;
  /// N x 3, m: the prediction of every training row from those at all other joint vectors.
  [[nodiscard]] Eigen::MatrixXd leave_one_out_mean_B() const;
  /// N x 3, m: standard deviation of the measurement of every training row, given the same. With
  /// more than 5000 poses: given the others of its expert (local_experts.h).
  [[nodiscard]] Eigen::MatrixXd leave_one_out_stddev_B() const;
  /// Errors of these observations when they are predicted from all others, with unchanged
  /// hyperparameters. `residual_B` (N x 3, m) replaces the observations. Empty for a kernel with
  /// blocks and for more than 5000 poses.
  [[nodiscard]] std::optional<Eigen::MatrixXd> left_out_error_B(
      const Eigen::MatrixXd& residual_B, const std::vector<Eigen::Index>& observations) const;

  [[nodiscard]] const BiasState& state() const;
  [[nodiscard]] const BiasFitReport& report() const;

 private:
  struct Fitted;
  [[nodiscard]] static Result<BiasModel> fit_from(const BiasProblem& problem,
                                                  const BiasOptions& options,
                                                  const BiasState* last);
  [[nodiscard]] Result<BiasModel> regrown(BiasState state,
                                          std::shared_ptr<const BiasOutputs> outputs) const;
  explicit BiasModel(std::shared_ptr<const Fitted> fitted) : fitted_(std::move(fitted)) {}
  std::shared_ptr<const Fitted> fitted_;
};

}  // namespace trammel
