#pragma once

#include <optional>
#include <vector>

#include "server/bias/process/gaussian_process.h"

namespace trammel {

/// One output with any number of points. Up to 5000 points it is one exact process. Beyond, it is
/// several exact processes of neighbouring points with common hyperparameters, the experts. The
/// robust Bayesian committee machine joins them (Deisenroth & Ng, ICML 2015): with β_k = ½
/// log(prior variance / v_k), precision = Σ β_k / v_k + (1 - Σ β_k) / prior. All experts predict
/// everywhere, so the prediction is as smooth as theirs. Far from all data it is the prior.
/// Immutable, thread-safe. Experts have 600 to 1200 points m; memory is 4 N m bytes, time N m².
class LocalExperts {
 public:
  /// Empty if a covariance is not positive definite. `form` applies to a single process. Several
  /// processes use kCompressed, since their variances decide the mean.
  [[nodiscard]] static std::optional<LocalExperts> condition(
      const std::shared_ptr<const Kernel>& kernel, const Eigen::MatrixXd& q,
      const Eigen::VectorXd& y, const Eigen::VectorXd& noise_shape,
      const GpHyperparameters& hyperparameters, VarianceForm form = VarianceForm::kLearned);

  /// The same functions as in GaussianProcess, in m² operations for each point. with() gives each
  /// point to the expert that knows it best. without() removes points from their experts, and drops
  /// an expert without points.
  [[nodiscard]] std::optional<LocalExperts> with(const Eigen::MatrixXd& q, const Eigen::VectorXd& y,
                                                 const Eigen::VectorXd& noise_shape) const;
  [[nodiscard]] LocalExperts without(const std::vector<Eigen::Index>& points) const;

  /// As GaussianProcess::left_out_error(); empty with more than one expert.
  [[nodiscard]] std::optional<Eigen::VectorXd> left_out_error(
      const Eigen::VectorXd& y, const std::vector<Eigen::Index>& points) const {
    if (experts_.size() > 1) return std::nullopt;
    return experts_.front().left_out_error(y, points);
  }

  void mean(const Eigen::MatrixXd& q, double* out) const;
  /// If `mean` is given, the call also writes the mean there. That is cheaper than two calls.
  [[nodiscard]] std::vector<PosteriorVariance> variance(const Eigen::MatrixXd& q,
                                                        double* mean = nullptr) const;

  [[nodiscard]] double signal_variance() const { return experts_.front().signal_variance(); }
  [[nodiscard]] double noise_variance() const { return experts_.front().noise_variance(); }
  /// Sum over the experts, each with its own data.
  [[nodiscard]] double log_likelihood() const;
  /// Every point predicted from the others of its expert.
  [[nodiscard]] Eigen::VectorXd leave_one_out_mean() const;
  [[nodiscard]] Eigen::VectorXd leave_one_out_share() const;
  [[nodiscard]] Eigen::VectorXd leave_one_out_variance() const;

  [[nodiscard]] Eigen::Index size() const { return size_; }
  [[nodiscard]] std::size_t experts() const { return experts_.size(); }

 private:
  struct Committee {
    Eigen::VectorXd mean, posterior, prior;
  };
  LocalExperts() = default;
  [[nodiscard]] Committee committee(const Eigen::MatrixXd& q) const;

  Eigen::Index size_ = 0;
  std::vector<GaussianProcess> experts_;
  std::vector<std::vector<Eigen::Index>> members_;  // of each expert, among all points
};

}  // namespace trammel
