#pragma once

#include <Eigen/Dense>
#include <memory>
#include <optional>
#include <vector>

#include "server/base/result.h"
#include "server/bias/bias_data.h"

/// What the physics leaves over, learned: joints -> residual of the tool position, with its uncertainty.
namespace trammel {

class BiasOutputs;

/// A fitted Gaussian process for each coordinate (source section 3.4, eqs. 3.15-3.26); where the kernel has blocks
/// (kernel_spelling.h) the coordinates share their weights, and whoever asks says the features of each pose. An
/// immutable value; copies share their tables. Thread-safe.
class BiasModel {
 public:
  /// Same problem, options and build of numerics.h, same model bit for bit. `none` predicts zero, with the rms of the
  /// residual as its stddev. The noise of observation i has variance σ_n² sigma_i²/median(sigma²), the ratio kept
  /// within [1/4, 4]; σ_n is learned for each output, with a weak prior against values below metrology's. Refuses fewer
  /// than 10 observations, non-finite numbers, a kernel that cannot be spelled, more than 4000 observations or missing
  /// features where it has blocks; kBusy when `progress` gives up.
  [[nodiscard]] static Result<BiasModel> fit(const BiasProblem& problem, const BiasOptions& options);
  /// Same state, same predictions, bit for bit on processors that run the same build of numerics.h (the last bits
  /// differ between AVX2 and AVX-512). Refuses what fit refuses, and hyperparameters of the wrong shape.
  [[nodiscard]] static Result<BiasModel> restore(const BiasState& state);

  /// More observations with the hyperparameters as they are: N² operations for each where the median sigma stays what
  /// it was and the kernel has no blocks, N³ otherwise. Equal to restoring the longer state, to rounding. Refuses what
  /// fit refuses.
  [[nodiscard]] Result<BiasModel> with(const BiasProblem& more) const;
  /// Without these observations (rising indices), likewise; refuses to keep fewer than 10.
  [[nodiscard]] Result<BiasModel> without(const std::vector<Eigen::Index>& observations) const;
  /// Fitted to its own observations again, from where the last fit ended: a few evaluations, no new starts.
  [[nodiscard]] Result<BiasModel> refit(const BiasOptions& options) const;

  /// Whether the kernel has blocks, so that features must be given; otherwise they are ignored.
  [[nodiscard]] bool needs_features() const;
  [[nodiscard]] BiasPrediction predict(const JointVector& q, const BiasFeatures& features = {}) const;
  /// The mean alone: what an iteration needs.
  [[nodiscard]] Vector3 mean_B(const JointVector& q, const BiasFeatures& features = {}) const;
  /// M x 3, m: BiasPrediction::nearby_B alone; rows of `q` are joint vectors.
  [[nodiscard]] Eigen::MatrixXd nearby_mean_all_B(const Eigen::MatrixXd& q) const;
  /// P: what the block `parameters` found of each parameter, in standard deviations that it had before any data; empty
  /// without that block.
  [[nodiscard]] Eigen::VectorXd parameter_weights() const;
  /// M x 3, m: the means alone of many; rows of `q` are joint vectors.
  [[nodiscard]] Eigen::MatrixXd mean_all_B(const Eigen::MatrixXd& q,
                                           const std::vector<BiasFeatures>& features = {}) const;
  /// Many at once; rows of `q` are joint vectors.
  [[nodiscard]] std::vector<BiasPrediction> predict_all(const Eigen::MatrixXd& q,
                                                        const std::vector<BiasFeatures>& features = {}) const;

  /// N, in [0, 1]: `prior_share` of every training pose when it is left out: what "known" looks like. A target whose
  /// own share is above, say, the 99 % quantile of these is farther from the data than they are from each other.
  [[nodiscard]] Eigen::VectorXd leave_one_out_prior_share() const;
  /// N x 3: prediction of every training pose from all the others, m.
  [[nodiscard]] Eigen::MatrixXd leave_one_out_mean_B() const;
  /// N x 3: of the measurement of every training pose given all the others (beyond 5000, of its expert), m.
  [[nodiscard]] Eigen::MatrixXd leave_one_out_stddev_B() const;
  /// What of `residual_B` (N x 3, m; measured instead of what it was fitted to) these observations miss by when they
  /// are predicted from all others, hyperparameters as found; empty where the kernel has blocks and beyond 5000.
  [[nodiscard]] std::optional<Eigen::MatrixXd> left_out_error_B(const Eigen::MatrixXd& residual_B,
                                                                const std::vector<Eigen::Index>& observations) const;

  [[nodiscard]] const BiasState& state() const;
  [[nodiscard]] const BiasFitReport& report() const;

 private:
  struct Fitted;
  [[nodiscard]] static Result<BiasModel> fit_from(const BiasProblem& problem, const BiasOptions& options,
                                                  const BiasState* last);
  [[nodiscard]] Result<BiasModel> regrown(BiasState state, std::shared_ptr<const BiasOutputs> outputs) const;
  explicit BiasModel(std::shared_ptr<const Fitted> fitted) : fitted_(std::move(fitted)) {}
  std::shared_ptr<const Fitted> fitted_;
};

}  // namespace trammel
