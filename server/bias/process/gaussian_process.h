#pragma once

#include <Eigen/Dense>
#include <cmath>
#include <memory>
#include <numbers>
#include <optional>
#include <vector>

#include "server/bias/kernels/kernel.h"
#include "server/bias/process/near_points.h"
#include "server/bias/process/variance_table.h"
#include "server/measurement/pose_groups.h"
#include "server/numerics/aligned_matrix.h"
#include "server/numerics/bfgs.h"

/// Exact Gaussian processes (source eqs. 3.15-3.26): K = σ_f² R(parameters) + σ_n² diag(w) = σ_f²
/// M, M = R + η diag(w).
namespace trammel {

inline const double kLogTwoPi = std::log(2.0 * std::numbers::pi);
/// Natural logarithms of hyperparameters beyond this are refused: their squares would be no numbers
/// to compute with.
inline constexpr double kMostLogParameter = 40.0;

/// The data that a process learns from. All outputs share the joint vectors.
struct GpData {
  Eigen::MatrixXd q;            ///< N x n, rad
  Eigen::MatrixXd y;            ///< N x outputs, m, mean removed
  Eigen::VectorXd noise_shape;  ///< N, w: noise variance of each point relative to σ_n²
};

/// Weak log-normal priors; they decide only parameters that the data leave open.
struct GpPrior {
  double noise_stddev = 1e-5;  ///< m, the instrument's; noise below it costs ½ (log ratio /
                               ///< spread)², noise above it nothing
  double noise_spread =
      0.1;  ///< in logs: the instrument's noise is known to 10 %; less noise would mean learning it
  Eigen::VectorXd parameter_centre;  ///< of the kernel's log parameters
  double parameter_spread =
      3.0;  ///< in logs: wide enough for the length scale of a joint without influence
  double log_ratio_centre = -4.6;  ///< of log η: noise a tenth of the signal
  double log_ratio_spread = 5.0;
};

/// Minus the log of (likelihood x prior) as a function of [kernel parameters, log η], summed over
/// the outputs. σ_f² of each output has its best value y'M⁻¹y / N. Keeps its matrix between calls:
/// for one thread at a time.
class ProfiledLikelihood {
 public:
  ProfiledLikelihood(std::shared_ptr<const Kernel> kernel, GpData data, GpPrior prior);

  /// False where M is not positive definite, or a parameter is beyond kMostLogParameter.
  [[nodiscard]] bool evaluate(const Eigen::VectorXd& parameters, ObjectiveValue* out);

  /// Both of the last evaluation that succeeded: σ_f² of each output, m²; rms of the Euclidean
  /// error of each point predicted from all other joint vectors, m.
  [[nodiscard]] const Eigen::VectorXd& signal_variance() const { return signal_variance_; }
  [[nodiscard]] double leave_one_out_rms() const;

  [[nodiscard]] Eigen::Index size() const { return data_.q.rows(); }
  [[nodiscard]] const GpData& data() const { return data_; }

 private:
  [[nodiscard]] Eigen::VectorXd contract(const Eigen::VectorXd& parameters, double ratio,
                                         const Eigen::VectorXd& output_weights);

  std::shared_ptr<const Kernel> kernel_;
  GpData data_;
  GpPrior prior_;
  std::vector<PoseGroup> poses_;
  AlignedMatrix matrix_;  // [M Yᵀ], then [-M⁻¹; Y M⁻¹]; lower triangle
  AlignedMatrix features_;
  AlignedMatrix alpha_;  // M⁻¹ Y
  AlignedMatrix work_;
  Eigen::VectorXd signal_variance_;
};

/// One output's hyperparameters.
struct GpHyperparameters {
  Eigen::VectorXd kernel;    ///< log parameters
  double log_signal_stddev;  ///< log σ_f, m
  double log_noise_stddev;   ///< log σ_n, m
};

/// The ways in which a process computes its variance.
enum class VarianceForm {
  /// From a few of its points, where few are enough: several times faster. At the data it is never
  /// below the exact variance, and above it by at most 0.001 σ_n². Elsewhere the standard deviation
  /// was measured to be at most 0.2 % too small (bound: decision 25). Exact where many points would
  /// be needed.
  kCompressed,
  /// The form in which a model is served. It uses the 24 or 48 points nearest to a target if they
  /// give as much as all points, mostly for a signal below the noise. Otherwise it uses at most 400
  /// points that replace all. If these do not suffice, it uses all points, in single precision if
  /// the noise allows it. The variance is never below the exact one. At every training point, left
  /// out, it is above the exact one by less than 2 %, mostly by far less. Data that only with(),
  /// without() and left_out_error() need are not kept; each call computes them anew.
  kServed,
  /// The variances of kServed, and all is kept.
  kLearned,
  /// As kServed, but less than 2 % of the variance of a measurement, for a process whose variance
  /// is one part of the uncertainty.
  kServedAsPart,
  kExact,
  /// As kCompressed, but if it is compressed, nothing else is kept. Data that grow with the square
  /// of the points and that only with(), without() and left_out_error() need are computed anew in
  /// each call.
  kCompressedOnly,
};

/// One output, conditioned on its data (eq. 3.17). Immutable, thread-safe.
class GaussianProcess {
 public:
  /// Empty when the covariance is not positive definite.
  [[nodiscard]] static std::optional<GaussianProcess> condition(
      std::shared_ptr<const Kernel> kernel, const Eigen::MatrixXd& q, const Eigen::VectorXd& y,
      const Eigen::VectorXd& noise_shape, const GpHyperparameters& hyperparameters,
      VarianceForm form = VarianceForm::kCompressed);

  /// Conditioned on more points, with the same hyperparameters, in N² operations for each point.
  /// Equal to condition() on all points, to rounding. Empty when the covariance is no longer
  /// positive definite.
  [[nodiscard]] std::optional<GaussianProcess> with(const Eigen::MatrixXd& q,
                                                    const Eigen::VectorXd& y,
                                                    const Eigen::VectorXd& noise_shape,
                                                    VarianceForm form = VarianceForm::kExact) const;
  /// Conditioned on all points but these (rising indices), in N² operations for each; equal to
  /// rounding, too.
  [[nodiscard]] GaussianProcess without(const std::vector<Eigen::Index>& points,
                                        VarianceForm form = VarianceForm::kExact) const;

  /// Errors of these points when they are predicted from all others, in N operations for each pair
  /// of them; `y` (N, m) replaces the observations.
  [[nodiscard]] Eigen::VectorXd left_out_error(const Eigen::VectorXd& y,
                                               const std::vector<Eigen::Index>& points) const;

  /// Posterior mean at `count` joint vectors (rows of `q`), m.
  void mean(const Eigen::MatrixXd& q, double* out) const;

  /// `near`: the points from which each variance was computed, if near ones suffice; otherwise it
  /// becomes empty. `mean` receives the posterior mean as well, equal to mean() up to rounding,
  /// which is cheaper than two calls.
  [[nodiscard]] std::vector<PosteriorVariance> variance(const Eigen::MatrixXd& q,
                                                        std::vector<NearWeights>* near = nullptr,
                                                        double* mean = nullptr) const;

  /// True if variances are computed from near points.
  [[nodiscard]] bool is_near_enough() const { return near_ > 0; }
  /// The number of points from which the variance of a target is computed.
  [[nodiscard]] Eigen::Index variance_points() const {
    return near_ > 0 ? near_ : compressed_ ? compressed_->size() : size_;
  }
  [[nodiscard]] double signal_variance() const { return signal_variance_; }
  [[nodiscard]] double noise_variance() const { return noise_variance_; }
  [[nodiscard]] double log_likelihood() const { return log_likelihood_; }

  /// Prediction of every training point from those at all other joint vectors: mean, m, and the
  /// ratio of posterior to prior variance of the function. For the points p of one joint vector it
  /// uses Rasmussen & Williams, eqs. 5.10-5.12, with a block of K⁻¹ instead of its diagonal: μ_p =
  /// y_p - [K⁻¹]_pp⁻¹ [K⁻¹ y]_p, Σ_p = [K⁻¹]_pp⁻¹ (noise included).
  [[nodiscard]] const Eigen::VectorXd& leave_one_out_mean() const { return leave_one_out_mean_; }
  [[nodiscard]] const Eigen::VectorXd& leave_one_out_share() const { return leave_one_out_share_; }
  /// Variance of the measurement of every training point given those at all other joint vectors,
  /// m².
  [[nodiscard]] Eigen::VectorXd leave_one_out_variance() const {
    return signal_variance_ * left_out_variance_;
  }

 private:
  GaussianProcess() = default;
  // With the same kernel and hyperparameters, and room for `size` points.
  [[nodiscard]] GaussianProcess like(Eigen::Index size) const;
  // Computes the members that follow from data, weights, inverse diagonal and root.
  void finish(VarianceForm form);
  // Leaves out the points of each joint vector together.
  void leave_poses_out();
  void compress(Eigen::Index at_most);
  // Chooses the points for served variances. It tests them at left-out points and at the rows of
  // `q`.
  void make_served(const Eigen::MatrixXd& q, bool as_part);
  [[nodiscard]] NearPoints near_points(Eigen::Index count) const;
  // The most variance that few points may leave where all points leave `left`.
  [[nodiscard]] Eigen::VectorXd at_most(const Eigen::VectorXd& left, bool as_part) const;
  // True if `count` near points leave at most the given variance, at left-out points and at the
  // rows of `asked`.
  [[nodiscard]] bool near_is_enough(Eigen::Index count, const Eigen::VectorXd& most_of_points,
                                    const FeatureBlock& asked, const Eigen::VectorXd& most) const;
  // The rows of the exact variance table: see VarianceTable::rows().
  [[nodiscard]] std::vector<double> root_rows(Eigen::Index more) const;

  std::shared_ptr<const Kernel> kernel_;
  Eigen::VectorXd parameters_;
  Eigen::Index size_ = 0;
  std::shared_ptr<AlignedMatrix> features_;
  Eigen::MatrixXd q_;  // N x n, rad: which points stand at one joint vector
  Eigen::VectorXd y_;
  Eigen::VectorXd noise_;             // relative to σ_f²
  AlignedMatrix weights_;             // M⁻¹ y
  Eigen::VectorXd inverse_diagonal_;  // of M⁻¹
  double log_det_ = 0;                // of M
  VarianceTable exact_;  // of all points; empty if only the data for served variances are kept
  std::optional<VarianceTable> compressed_;
  Eigen::Index near_ =
      0;  // points that a target's variance is computed from; 0: not from near ones
  double signal_variance_ = 0;
  double noise_variance_ = 0;
  double log_likelihood_ = 0;
  Eigen::VectorXd left_out_variance_;  // relative to σ_f², noise included
  Eigen::VectorXd leave_one_out_mean_;
  Eigen::VectorXd leave_one_out_share_;
};

}  // namespace trammel
