#pragma once

#include <Eigen/Dense>
#include <memory>
#include <optional>
#include <vector>

#include "server/bias/kernels/kernel.h"
#include "server/bias/process/variance_table.h"
#include "server/numerics/aligned_matrix.h"
#include "server/numerics/bfgs.h"

/// Exact Gaussian processes (source eqs. 3.15-3.26): K = σ_f² R(parameters) + σ_n² diag(w) = σ_f² M, M = R + η diag(w).
namespace trammel {

/// What a process learns from. All outputs share the joint vectors.
struct GpData {
  Eigen::MatrixXd q;            ///< N x n, rad
  Eigen::MatrixXd y;            ///< N x outputs, m, mean removed
  Eigen::VectorXd noise_shape;  ///< N, w: noise variance of each point relative to σ_n²
};

/// Weak log-normal priors; they decide only what the data leave open.
struct GpPrior {
  double noise_stddev = 1e-5;  ///< m, from metrology; below it the noise costs ½ (log ratio / spread)², above 0
  double noise_spread = 0.1;   ///< in logs: metrology is believed to 10 %; noise below it would be learned as bias
  Eigen::VectorXd parameter_centre;  ///< of the kernel's log parameters
  double parameter_spread = 3.0;     ///< in logs: keeps an idle joint's length scale from running away
  double log_ratio_centre = -4.6;    ///< of log η
  double log_ratio_spread = 5.0;
};

/// Minus the log of (likelihood x prior) as a function of [kernel parameters, log η], summed over the outputs, with the
/// σ_f² of each output at its best value y'M⁻¹y / N. Keeps its matrix between calls: one thread at a time.
class ProfiledLikelihood {
 public:
  ProfiledLikelihood(std::shared_ptr<const Kernel> kernel, GpData data, GpPrior prior);

  /// False when M is not positive definite or the parameters are absurd.
  [[nodiscard]] bool evaluate(const Eigen::VectorXd& parameters, ObjectiveValue* out);

  /// Of the last successful evaluation: σ_f² of each output, m²; rms over the points of the Euclidean leave-one-out
  /// error, m.
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

/// How a process keeps what its variance needs.
enum class VarianceForm {
  /// In a few of its points, where few are enough: several times faster. At the data never below the exact variance;
  /// elsewhere measured 0.2 % of the stddev below it at most (bound: DECISIONS.md), and above it by what the few leave
  /// unexplained, at the data 0.001 σ_n². Exact where they would not be few.
  kCompressed,
  kExact,
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

  /// Conditioned on more points too, with the same hyperparameters, in N² operations a point; equal to `condition` on
  /// all of them to rounding. Empty when the covariance is no longer positive definite.
  [[nodiscard]] std::optional<GaussianProcess> with(const Eigen::MatrixXd& q, const Eigen::VectorXd& y,
                                                    const Eigen::VectorXd& noise_shape,
                                                    VarianceForm form = VarianceForm::kExact) const;
  /// Conditioned on all points but these (rising indices), in N² operations a point; to rounding as `with`.
  [[nodiscard]] GaussianProcess without(const std::vector<Eigen::Index>& points,
                                        VarianceForm form = VarianceForm::kExact) const;

  /// What of `y` (N, m; observations instead of those conditioned on) these points miss by when they are predicted from
  /// all others, in N operations a pair of them.
  [[nodiscard]] Eigen::VectorXd left_out_error(const Eigen::VectorXd& y, const std::vector<Eigen::Index>& points) const;

  /// Posterior mean at `count` joint vectors (rows of `q`), m.
  void mean(const Eigen::MatrixXd& q, double* out) const;

  [[nodiscard]] std::vector<PosteriorVariance> variance(const Eigen::MatrixXd& q) const;

  /// How many points the variance is computed from.
  [[nodiscard]] Eigen::Index variance_points() const { return compressed_ ? compressed_->size() : size_; }
  [[nodiscard]] double signal_variance() const { return signal_variance_; }
  [[nodiscard]] double noise_variance() const { return noise_variance_; }
  [[nodiscard]] double log_likelihood() const { return log_likelihood_; }

  /// Mean of every training point from all the others, m; posterior / prior variance share of the function there
  /// (Rasmussen & Williams, eqs. 5.10-5.12).
  [[nodiscard]] const Eigen::VectorXd& leave_one_out_mean() const { return leave_one_out_mean_; }
  [[nodiscard]] const Eigen::VectorXd& leave_one_out_share() const { return leave_one_out_share_; }
  /// Variance of the measurement of every training point given all the others, m².
  [[nodiscard]] Eigen::VectorXd leave_one_out_variance() const {
    return signal_variance_ * inverse_diagonal_.cwiseInverse();
  }

 private:
  GaussianProcess() = default;
  // Of the same kernel and hyperparameters, without data.
  [[nodiscard]] GaussianProcess like(Eigen::Index size) const;
  // What follows from the data, weights, inverse diagonal and root.
  void finish(VarianceForm form);
  void compress();

  std::shared_ptr<const Kernel> kernel_;
  Eigen::VectorXd parameters_;
  Eigen::Index size_ = 0;
  AlignedMatrix features_;
  Eigen::VectorXd y_;
  Eigen::VectorXd noise_;             // relative to σ_f²
  AlignedMatrix weights_;             // M⁻¹ y
  Eigen::VectorXd inverse_diagonal_;  // of M⁻¹
  double log_det_ = 0;                // of M
  VarianceTable exact_;               // of all points
  std::optional<VarianceTable> compressed_;
  double signal_variance_ = 0;
  double noise_variance_ = 0;
  double log_likelihood_ = 0;
  Eigen::VectorXd leave_one_out_mean_;
  Eigen::VectorXd leave_one_out_share_;
};

}  // namespace trammel
