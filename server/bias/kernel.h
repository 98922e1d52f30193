#pragma once

#include <Eigen/Dense>
#include <memory>
#include <string>
#include <string_view>

/// Covariance functions of joint vectors (source eqs. 3.18-3.24), without amplitude: σ_f² is the process', not theirs.
namespace trammel {

/// Rows of a table of features: one column per feature, one row per joint vector. As `a` below the block must be
/// followed by the padding of its table (padded_rows) or by more rows.
struct FeatureBlock {
  const double* data = nullptr;
  Eigen::Index rows = 0;
  Eigen::Index ld = 0;
};

/// Where a search of the kernel's parameters starts, natural logarithms.
struct SearchBox {
  Eigen::VectorXd low;
  Eigen::VectorXd high;
};

/// One covariance function: a value without state, its parameters are passed in as natural logarithms.
/// Work is done in tiles, so that a sum or a product of kernels is a few lines over the tiles of its parts.
/// Thread-safe.
class Kernel {
 public:
  virtual ~Kernel() = default;

  [[nodiscard]] virtual std::string_view name() const = 0;
  [[nodiscard]] virtual Eigen::Index parameter_count(Eigen::Index joints) const = 0;
  [[nodiscard]] virtual Eigen::Index feature_count(Eigen::Index joints) const = 0;
  [[nodiscard]] virtual SearchBox search_box(const Eigen::MatrixXd& q) const = 0;

  /// Joint vectors (rows of `q`, rad) as features, into the first rows of a table with leading dimension `ld`.
  virtual void features(const Eigen::VectorXd& parameters, const Eigen::MatrixXd& q, double* table,
                        Eigen::Index ld) const = 0;

  /// k(x, x) of every row of `a`.
  virtual void diagonal(const Eigen::VectorXd& parameters, const FeatureBlock& a, double* k) const = 0;
  /// k(i, j) of rows i of `a` and j of `b`, column-major with leading dimension `ldk` >= padded_rows(a.rows).
  virtual void tile(const Eigen::VectorXd& parameters, const FeatureBlock& a, const FeatureBlock& b, double* k,
                    Eigen::Index ldk) const = 0;
  /// gradient[p] += Σ_ij g_ij ∂k_ij/∂parameter p; `g` is laid out like `k`, zero in the padding.
  virtual void tile_gradient(const Eigen::VectorXd& parameters, const FeatureBlock& a, const FeatureBlock& b,
                             const double* g, Eigen::Index ldg, double* gradient) const = 0;
  /// out[j] = Σ_i weights_i k(a_i, b_j); `weights` has zeros up to padded_rows(a.rows).
  virtual void weighted_sum(const Eigen::VectorXd& parameters, const FeatureBlock& a, const FeatureBlock& b,
                            const double* weights, double* out) const = 0;
};

/// The kernel of that name, or null. `kernel_names` lists them for messages.
[[nodiscard]] std::shared_ptr<const Kernel> make_kernel(std::string_view name);
[[nodiscard]] std::string kernel_names();

/// Squared exponential (eq. 3.19, one length scale per joint) and Matérn 3/2, 5/2 (eq. 3.20): `se`, `matern32`,
/// `matern52`; null otherwise. Parameters: log length scale of each joint, rad.
[[nodiscard]] std::shared_ptr<const Kernel> make_radial_kernel(std::string_view name);

}  // namespace trammel
