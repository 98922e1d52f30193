#pragma once

#include <Eigen/Dense>
#include <cmath>
#include <functional>
#include <memory>
#include <numbers>
#include <optional>
#include <vector>

#include "server/bias/kernels/kernel.h"
#include "server/bias/process/regional_variance.h"
#include "server/bias/process/variance_table.h"
#include "server/numerics/aligned_matrix.h"
#include "server/numerics/bfgs.h"

/// Exact Gaussian processes (source eqs. 3.15-3.26): K = σ_f² R(parameters) + σ_n² diag(w) = σ_f² M, M = R + η diag(w).
namespace trammel {

inline const double kLogTwoPi = std::log(2.0 * std::numbers::pi);
/// Natural logarithms of hyperparameters beyond this are refused: their squares would be no numbers to compute with.
inline constexpr double kMostLogParameter = 40.0;

/// What a process learns from. All outputs share the joint vectors.
struct GpData {
  Eigen::MatrixXd q;            ///< N x n, rad
  Eigen::MatrixXd y;            ///< N x outputs, m, mean removed
  Eigen::VectorXd noise_shape;  ///< N, w: noise variance of each point relative to σ_n²
};

/// Weak log-normal priors; they decide only what the data leave open.
struct GpPrior {
  double noise_stddev =
      1e-5;  ///< m, the instrument's; noise below it costs ½ (log ratio / spread)², noise above it nothing
  double noise_spread = 0.1;  ///< in logs: the instrument's noise is known to 10 %; less noise would mean learning it
  Eigen::VectorXd parameter_centre;  ///< of the kernel's log parameters
  double parameter_spread = 3.0;     ///< in logs: holds the length scale of a joint that has no influence
  double log_ratio_centre = -4.6;    ///< of log η: noise a tenth of the signal
  double log_ratio_spread = 5.0;
};

/// Minus the log of (likelihood x prior) as a function of [kernel parameters, log η], summed over the outputs. σ_f² of
/// each output is at its best value y'M⁻¹y / N. Keeps its matrix between calls: for one thread at a time.
class ProfiledLikelihood {
 public:
  ProfiledLikelihood(std::shared_ptr<const Kernel> kernel, GpData data, GpPrior prior);

  /// False where M is not positive definite, or a parameter is beyond kMostLogParameter.
  [[nodiscard]] bool evaluate(const Eigen::VectorXd& parameters, ObjectiveValue* out);

  /// Both of the last evaluation that succeeded: σ_f² of each output, m²; rms of the Euclidean leave-one-out error, m.
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

/// How a process computes its variance.
enum class VarianceForm {
  /// From a few of its points, where few are enough: several times faster. At the data it is never below the exact
  /// variance, and above it by at most 0.001 σ_n². Elsewhere the standard deviation was measured to be at most 0.2 %
  /// too
  /// small (bound: DECISIONS.md). Exact where many points would be needed.
  kCompressed,
  /// The same where 400 points are enough. Else from a few directions for each region of joint space
  /// (regional_variance.h), some ten times faster for a single target. Then it is nowhere below the exact variance, and
  /// above it by so much that the standard deviation of a measurement is too large by less than 1 % at most targets,
  /// and
  /// by 2 % where it is noticed: there the exact variance takes over.
  kRegional,
  /// As kRegional, and as kCompressedOnly where it is compressed.
  kRegionalOnly,
  /// As kRegionalOnly with 3 % and 6 %: for figures that decide nothing.
  kRough,
  kExact,
  /// As kCompressed, and where it is compressed nothing else is kept: what grows with the square of the points and is
  /// for with(), without() and left_out_error() alone is computed anew when one of them is called.
  kCompressedOnly,
};

/// One output, conditioned on its data (eq. 3.17). Immutable, thread-safe.
class GaussianProcess {
 public:
  /// Empty when the covariance is not positive definite.
  [[nodiscard]] static std::optional<GaussianProcess> condition(std::shared_ptr<const Kernel> kernel,
                                                                const Eigen::MatrixXd& q, const Eigen::VectorXd& y,
                                                                const Eigen::VectorXd& noise_shape,
                                                                const GpHyperparameters& hyperparameters,
                                                                VarianceForm form = VarianceForm::kCompressed);

  /// Conditioned on more points, with the same hyperparameters, in N² operations for each point. Equal to condition()
  /// on all points, to rounding. Empty when the covariance is no longer positive definite.
  [[nodiscard]] std::optional<GaussianProcess> with(const Eigen::MatrixXd& q, const Eigen::VectorXd& y,
                                                    const Eigen::VectorXd& noise_shape,
                                                    VarianceForm form = VarianceForm::kExact) const;
  /// Conditioned on all points but these (rising indices), in N² operations for each; equal to rounding, too.
  [[nodiscard]] GaussianProcess without(const std::vector<Eigen::Index>& points,
                                        VarianceForm form = VarianceForm::kExact) const;

  /// Errors of these points when they are predicted from all others, in N operations for each pair of them; `y` (N, m)
  /// takes the place of the observations.
  [[nodiscard]] Eigen::VectorXd left_out_error(const Eigen::VectorXd& y, const std::vector<Eigen::Index>& points) const;

  /// Posterior mean at `count` joint vectors (rows of `q`), m.
  void mean(const Eigen::MatrixXd& q, double* out) const;

  [[nodiscard]] std::vector<PosteriorVariance> variance(const Eigen::MatrixXd& q) const;

  /// How many points the variance is computed from, where it is the same for all targets.
  [[nodiscard]] Eigen::Index variance_points() const { return compressed_ ? compressed_->size() : size_; }
  /// Works out all regions before targets ask for them, while `go_on` says so.
  void prepare(const std::function<bool()>& go_on) const {
    for (std::size_t i = 0; regional_ && i < regional_->regions() && go_on(); ++i) regional_->prepare(exact_, i);
  }
  [[nodiscard]] double signal_variance() const { return signal_variance_; }
  [[nodiscard]] double noise_variance() const { return noise_variance_; }
  [[nodiscard]] double log_likelihood() const { return log_likelihood_; }

  /// Every training point predicted from all the others: mean, m, and posterior over prior variance of the function
  /// (Rasmussen & Williams, eqs. 5.10-5.12).
  [[nodiscard]] const Eigen::VectorXd& leave_one_out_mean() const { return leave_one_out_mean_; }
  [[nodiscard]] const Eigen::VectorXd& leave_one_out_share() const { return leave_one_out_share_; }
  /// Variance of the measurement of every training point given all the others, m².
  [[nodiscard]] Eigen::VectorXd leave_one_out_variance() const {
    return signal_variance_ * inverse_diagonal_.cwiseInverse();
  }

 private:
  GaussianProcess() = default;
  // With the same kernel and hyperparameters, and room for `size` points.
  [[nodiscard]] GaussianProcess like(Eigen::Index size) const;
  // Computes what follows from data, weights, inverse diagonal and root; not VarianceForm::kRegional.
  void finish(VarianceForm form);
  void compress(Eigen::Index at_most);
  // Of the exact variance table; VarianceTable::rows().
  [[nodiscard]] std::vector<double> root_rows(Eigen::Index more) const;

  std::shared_ptr<const Kernel> kernel_;
  Eigen::VectorXd parameters_;
  Eigen::Index size_ = 0;
  AlignedMatrix features_;
  Eigen::VectorXd y_;
  Eigen::VectorXd noise_;             // relative to σ_f²
  AlignedMatrix weights_;             // M⁻¹ y
  Eigen::VectorXd inverse_diagonal_;  // of M⁻¹
  double log_det_ = 0;                // of M
  VarianceTable exact_;               // of all points; empty where only the compressed one is kept
  std::optional<VarianceTable> compressed_;
  std::shared_ptr<const RegionalVariance> regional_;
  double signal_variance_ = 0;
  double noise_variance_ = 0;
  double log_likelihood_ = 0;
  Eigen::VectorXd leave_one_out_mean_;
  Eigen::VectorXd leave_one_out_share_;
};

}  // namespace trammel
