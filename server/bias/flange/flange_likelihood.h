#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "server/bias/coupled/coupled_likelihood.h"
#include "server/bias/flange/flange_views.h"

namespace trammel {

/// Hyperparameters of a bias at the flange are CoupledHyperparameters. `outputs` has the three
/// coordinates of the position, all with the same noise; `blocks` has the rotation: kernel
/// parameters, and log σ of one axis (rad).
inline constexpr std::size_t kTwistKernels =
    4;  ///< x, y, z; the three axes of the rotation share the last

/// The kernel of one number of the twist.
[[nodiscard]] constexpr std::size_t kernel_of(Eigen::Index number) {
  return number < 3 ? static_cast<std::size_t>(number) : kTwistKernels - 1;
}
/// Parameters of these kernels, and prior variances of the six numbers.
[[nodiscard]] std::vector<Eigen::VectorXd> twist_parameters(const CoupledHyperparameters& at);
[[nodiscard]] Vector6 twist_variance(const CoupledHyperparameters& at);

/// The values that follow from one set of hyperparameters.
struct FlangeSolution {
  std::vector<AlignedMatrix> features;    ///< of each kernel
  std::vector<AlignedMatrix> covariance;  ///< of each kernel, M x M, without amplitude
  AlignedMatrix eliminated;               ///< [-C⁻¹ .; zᵀ C⁻¹], lower triangle
  Eigen::VectorXd alpha;                  ///< C⁻¹ z
  double log_likelihood = 0;
};

/// Empty when the covariance is not positive definite.
[[nodiscard]] std::optional<FlangeSolution> solve(const Kernel& kernel, const FlangeViews& views,
                                                  const SeenNumbers& seen,
                                                  const CoupledHyperparameters& at);

/// Weak priors, as GpPrior of one process.
struct FlangePrior {
  double noise_stddev = 1e-5;  ///< m, the instrument's
  double noise_spread = 0.1;
  Eigen::VectorXd parameter_centre;
  double parameter_spread = 3.0;
  Eigen::VectorXd rotation_centre;  ///< of CoupledHyperparameters::blocks
  double rotation_spread = 1.0;
  double signal_centre = 0;  ///< of log σ_f
  double signal_spread = 5.0;
};

/// Minus the log of (likelihood x prior), as a function of: kernel parameters of x, y, z; log σ_f
/// of each; log σ_n; hyperparameters of the rotation.
class FlangeLikelihood {
 public:
  FlangeLikelihood(KernelPtr kernel, FlangeViews views, SeenNumbers seen, FlangePrior prior);

  [[nodiscard]] bool evaluate(const Eigen::VectorXd& x, ObjectiveValue* out) const;
  [[nodiscard]] CoupledHyperparameters unpack(const Eigen::VectorXd& x) const;
  [[nodiscard]] Eigen::VectorXd pack(const CoupledHyperparameters& at) const;

 private:
  void add_prior(const Eigen::VectorXd& x, ObjectiveValue* out) const;
  /// For each kernel, M x M, lower triangle: the derivative of minus the log likelihood by its
  /// entries. And by log σ_n.
  [[nodiscard]] std::vector<AlignedMatrix> by_covariance(const FlangeSolution& solution,
                                                         const Vector6& variance) const;

  KernelPtr kernel_;
  FlangeViews views_;
  SeenNumbers seen_;
  FlangePrior prior_;
  Eigen::Index parameters_;  // of the kernel
};

}  // namespace trammel
