#pragma once

#include <optional>
#include <vector>

#include "server/bias/process/gaussian_process.h"

namespace trammel {

/// One output of any number of points: one exact process up to 5000; beyond, exact processes of neighbouring points
/// that share their hyperparameters, joined by the robust Bayesian committee machine (Deisenroth & Ng, ICML 2015): with
/// β_k = ½ log(prior variance / v_k), precision = Σ β_k / v_k + (1 - Σ β_k) / prior. Every expert speaks everywhere, so
/// prediction is as smooth as theirs; where none knows anything it is the prior. Immutable, thread-safe. Memory is
/// 4 N m bytes for experts of m points, between 600 and 1200; time N m².
class LocalExperts {
 public:
  /// Empty when a covariance is not positive definite.
  [[nodiscard]] static std::optional<LocalExperts> condition(const std::shared_ptr<const Kernel>& kernel,
                                                             const Eigen::MatrixXd& q, const Eigen::VectorXd& y,
                                                             const Eigen::VectorXd& noise_shape,
                                                             const GpHyperparameters& hyperparameters);

  /// As GaussianProcess has them; `with` gives each point to the expert that knows most of it, in m² operations;
  /// `without` takes the points out of their experts, and an expert that has none left with them.
  [[nodiscard]] std::optional<LocalExperts> with(const Eigen::MatrixXd& q, const Eigen::VectorXd& y,
                                                 const Eigen::VectorXd& noise_shape) const;
  [[nodiscard]] LocalExperts without(const std::vector<Eigen::Index>& points) const;

  /// As GaussianProcess has it; empty where there is more than one expert.
  [[nodiscard]] std::optional<Eigen::VectorXd> left_out_error(const Eigen::VectorXd& y,
                                                              const std::vector<Eigen::Index>& points) const {
    if (experts_.size() > 1) return std::nullopt;
    return experts_.front().left_out_error(y, points);
  }

  void mean(const Eigen::MatrixXd& q, double* out) const;
  [[nodiscard]] std::vector<PosteriorVariance> variance(const Eigen::MatrixXd& q) const;

  [[nodiscard]] double signal_variance() const { return experts_.front().signal_variance(); }
  [[nodiscard]] double noise_variance() const { return experts_.front().noise_variance(); }
  /// Of the experts' data each by itself.
  [[nodiscard]] double log_likelihood() const;
  /// Of every point from the others of its own expert.
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
