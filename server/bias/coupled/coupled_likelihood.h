#pragma once

#include <Eigen/Dense>
#include <memory>
#include <optional>
#include <vector>

#include "server/bias/kernels/linear_block.h"
#include "server/bias/process/gaussian_process.h"
#include "server/numerics/aligned_matrix.h"
#include "server/numerics/bfgs.h"

/// Gaussian processes of several coordinates that share the weights of a linear block:
///   y_d = H_d w + g_d + noise,  w ~ N(0, Λ),  g_d + noise ~ N(0, M_d),  M_d = σ_f² R + σ_n²
///   diag(shape).
/// By Woodbury, with H scaled by Λ^½: A = I + Σ_d H_dᵀ M_d⁻¹ H_d, ŵ = A⁻¹ Σ_d H_dᵀ M_d⁻¹ y_d,
///   C⁻¹ = M⁻¹ - M⁻¹ H A⁻¹ Hᵀ M⁻¹,  α = C⁻¹ y = M⁻¹ (y - H ŵ),
///   -2 log L = Σ_d [y_dᵀ M_d⁻¹ y_d + log|M_d|] + log|A| - ŵᵀ A ŵ + const.
namespace trammel {

struct CoupledData {
  Eigen::MatrixXd q;                     ///< N x n, rad
  Eigen::MatrixXd y;                     ///< N x D
  Eigen::VectorXd noise_shape;           ///< N, noise variance of each point relative to σ_n²
  std::vector<Eigen::MatrixXd> columns;  ///< D times N x p: H before it is scaled
};

/// All in natural logarithms.
struct CoupledHyperparameters {
  std::vector<GpHyperparameters> outputs;
  Eigen::VectorXd blocks;
};

/// The values that follow from one set of hyperparameters.
struct CoupledSolution {
  std::vector<AlignedMatrix> eliminated;  ///< D: [-M⁻¹ .; y M⁻¹; Hᵀ M⁻¹ ...], lower triangle
  std::vector<AlignedMatrix> features;  ///< D: the kernel's, of all points
  Eigen::MatrixXd A;                    ///< p x p, lower triangle
  Eigen::LLT<Eigen::MatrixXd> root;     ///< of A
  Eigen::VectorXd weights;              ///< ŵ, for the scaled H
  Eigen::MatrixXd alpha;                ///< N x D
  Eigen::VectorXd column_scale;         ///< Λ^½
  Eigen::MatrixXd variance_slope;       ///< of log Λ by the blocks' hyperparameters
  double log_likelihood = 0;
};

/// Empty when a covariance is not positive definite.
[[nodiscard]] std::optional<CoupledSolution> solve(const Kernel& kernel, const LinearBlocks& blocks,
                                                   const CoupledData& data,
                                                   const CoupledHyperparameters& at);

/// C⁻¹ of one output with itself. The rows and columns from p on contain its lower triangle. The
/// earlier ones contain -A⁻¹ and A⁻¹ Hᵀ M⁻¹.
[[nodiscard]] AlignedMatrix precision_of(const CoupledSolution& solution, Eigen::Index points,
                                         Eigen::Index output);

/// Weak priors, as GpPrior of one process.
struct CoupledPrior {
  Eigen::VectorXd noise_stddev;  ///< D, the instrument's
  double noise_spread = 0.1;
  Eigen::VectorXd parameter_centre;
  double parameter_spread = 3.0;
  Eigen::VectorXd signal_centre;  ///< D, of log σ_f
  double signal_spread = 5.0;
  bool shared_scales = true;  ///< one set of kernel parameters for all outputs
};

/// Minus the log of (likelihood x prior), as a function of: kernel parameters, once or for each
/// output; log σ_f of each output; log σ_n of each output; hyperparameters of the blocks.
class CoupledLikelihood {
 public:
  CoupledLikelihood(std::shared_ptr<const Kernel> kernel, LinearBlocks blocks, CoupledData data,
                    CoupledPrior prior);

  [[nodiscard]] bool evaluate(const Eigen::VectorXd& x, ObjectiveValue* out) const;

  [[nodiscard]] CoupledHyperparameters unpack(const Eigen::VectorXd& x) const;
  [[nodiscard]] Eigen::VectorXd pack(const CoupledHyperparameters& at) const;
  [[nodiscard]] Eigen::Index size() const { return data_.q.rows(); }

 private:
  [[nodiscard]] Eigen::Index outputs() const { return data_.y.cols(); }
  [[nodiscard]] Eigen::Index kernel_sets() const { return prior_.shared_scales ? 1 : outputs(); }
  void add_prior(const Eigen::VectorXd& x, ObjectiveValue* out) const;
  /// ½ tr((C⁻¹ - α αᵀ) dM_d) by kernel parameters, log σ_f and log σ_n of one output; `precision`
  /// is precision_of().
  [[nodiscard]] Eigen::VectorXd contract(const CoupledSolution& solution,
                                         const GpHyperparameters& at,
                                         const AlignedMatrix& precision, Eigen::Index output) const;

  std::shared_ptr<const Kernel> kernel_;
  LinearBlocks blocks_;
  CoupledData data_;
  CoupledPrior prior_;
  Eigen::Index kernel_parameters_;
};

}  // namespace trammel
