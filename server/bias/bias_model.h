#pragma once

#include <Eigen/Dense>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "server/base/result.h"
#include "server/robot/pose.h"

/// What the physics leaves over, learned: joints -> residual of the tool position, with its uncertainty.
namespace trammel {

class LocalExperts;

/// N observations of the residual measured - calibrated.
struct BiasProblem {
  Eigen::MatrixXd q;           ///< N x n, rad
  Eigen::MatrixXd residual_B;  ///< N x 3, m, expressed in B
  Eigen::VectorXd sigma;       ///< N, m: what metrology says of one coordinate of each observation
};

struct BiasOptions {
  std::string kernel = "se";  ///< `se`, `matern52`, `none`, ... as spelled in the cell file
  int starts = 20;            ///< of the hyperparameter search, log-uniform
  std::uint64_t seed = 1;
  /// Called between steps with the share done in [0, 1]; return false to give up.
  std::function<bool(double)> progress;
};

/// At one joint vector, for the three coordinates in B.
struct BiasPrediction {
  Vector3 mean_B = Vector3::Zero();             ///< m
  Vector3 stddev_B = Vector3::Zero();           ///< m, of the function itself
  Vector3 measured_stddev_B = Vector3::Zero();  ///< m, of one noisy measurement of it
  double prior_share =
      1.0;  ///< posterior variance of the function / prior variance, largest coordinate; 0 known, 1 not
};

/// All that must be kept to restore a fitted model exactly: no factor, no table.
struct BiasState {
  std::string kernel;
  Eigen::MatrixXd q;                ///< N x n, rad
  Eigen::MatrixXd residual_B;       ///< N x 3, m
  Eigen::VectorXd sigma;            ///< N, m
  Eigen::VectorXd offset;           ///< per output, m: the mean residual, what the model says far from all data
  Eigen::MatrixXd hyperparameters;  ///< one column per output; rows as the kernel orders them, natural logarithms
};

/// How the fit went, for the report.
struct BiasFitReport {
  Eigen::Vector3d log_likelihood = Eigen::Vector3d::Zero();  ///< nat, per output
  Eigen::Vector3d noise_stddev = Eigen::Vector3d::Zero();    ///< m
  double leave_one_out_rms = 0;                              ///< m, Euclidean
  int starts_at_best = 0;  ///< how many starts reached the best optimum of the subset within 0.1 nat
  int evaluations = 0;     ///< of the full likelihood and gradient
};

/// A fitted Gaussian process for each coordinate (source section 3.4, eqs. 3.15-3.26). An immutable value;
/// copies share their tables. Thread-safe.
class BiasModel {
 public:
  /// Same problem, options and build of numerics.h, same model bit for bit. `none` predicts zero, with the rms of the
  /// residual as its stddev. The noise of observation i has variance σ_n² sigma_i²/median(sigma²), the ratio kept
  /// within [1/4, 4]; σ_n is learned for each output, with a weak prior against values below metrology's. Refuses fewer
  /// than 10 observations, non-finite numbers, an unknown kernel name, and to go on when told to stop.
  [[nodiscard]] static Result<BiasModel> fit(const BiasProblem& problem, const BiasOptions& options);
  /// Same state, same predictions, bit for bit on processors that run the same build of numerics.h (the last bits
  /// differ between AVX2 and AVX-512). Refuses what fit refuses, and hyperparameters of the wrong shape.
  [[nodiscard]] static Result<BiasModel> restore(const BiasState& state);

  /// More observations with the hyperparameters as they are: N² operations for each where the median sigma stays what
  /// it was, N³ otherwise. Equal to restoring the longer state, to rounding. Refuses what fit refuses.
  [[nodiscard]] Result<BiasModel> with(const BiasProblem& more) const;
  /// Without these observations (rising indices), likewise; refuses to keep fewer than 10.
  [[nodiscard]] Result<BiasModel> without(const std::vector<Eigen::Index>& observations) const;
  /// Fitted to its own observations again, from where the last fit ended: a few evaluations, no new starts.
  [[nodiscard]] Result<BiasModel> refit(const BiasOptions& options) const;

  [[nodiscard]] BiasPrediction predict(const JointVector& q) const;
  /// The mean alone: what an iteration needs.
  [[nodiscard]] Vector3 mean_B(const JointVector& q) const;
  /// M x 3, m: the means alone of many; rows of `q` are joint vectors.
  [[nodiscard]] Eigen::MatrixXd mean_all_B(const Eigen::MatrixXd& q) const;
  /// Many at once; rows of `q` are joint vectors.
  [[nodiscard]] std::vector<BiasPrediction> predict_all(const Eigen::MatrixXd& q) const;

  /// N, in [0, 1]: `prior_share` of every training pose when it is left out: what "known" looks like. A target whose
  /// own share is above, say, the 99 % quantile of these is farther from the data than they are from each other.
  [[nodiscard]] Eigen::VectorXd leave_one_out_prior_share() const;
  /// N x 3: prediction of every training pose from all the others, m.
  [[nodiscard]] Eigen::MatrixXd leave_one_out_mean_B() const;
  /// N x 3: of the measurement of every training pose given all the others (beyond 5000, of its expert), m.
  [[nodiscard]] Eigen::MatrixXd leave_one_out_stddev_B() const;

  [[nodiscard]] const BiasState& state() const;
  [[nodiscard]] const BiasFitReport& report() const;

 private:
  struct Fitted;
  [[nodiscard]] static Result<BiasModel> fit_from(const BiasProblem& problem, const BiasOptions& options,
                                                  const BiasState* last);
  [[nodiscard]] Result<BiasModel> regrown(BiasState state, std::vector<LocalExperts> outputs) const;
  explicit BiasModel(std::shared_ptr<const Fitted> fitted) : fitted_(std::move(fitted)) {}
  std::shared_ptr<const Fitted> fitted_;
};

}  // namespace trammel
