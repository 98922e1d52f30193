#pragma once

#include <Eigen/Dense>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

/// Covariance functions of joint vectors (source eqs. 3.18-3.24), without amplitude: σ_f² belongs
/// to the process.
namespace trammel {

/// Rows of a table of features: a column for each feature, a row for each joint vector. The
/// argument `a` of a Kernel must be followed by the padding of its table (padded_rows()) or by more
/// rows.
struct FeatureBlock {
  const double* data = nullptr;
  Eigen::Index rows = 0;
  Eigen::Index ld = 0;
};

/// `count` rows from `first` of a table, an AlignedMatrix or a MatrixXd.
template <typename Table>
[[nodiscard]] FeatureBlock rows_of(const Table& features, Eigen::Index first, Eigen::Index count) {
  return {features.data() + first, count, features.rows()};
}

/// Rows and columns of a tile: covariance, weights and the features of both sides stay in the
/// second-level cache.
inline constexpr Eigen::Index kTile = 64;

/// The box that a search of the kernel's parameters starts in, natural logarithms.
struct SearchBox {
  Eigen::VectorXd low;
  Eigen::VectorXd high;
};

/// One covariance function. A value without state: its parameters are passed in as natural
/// logarithms, some for each joint and some for all joints. Works in tiles, so that a sum or a
/// product of kernels is a few lines over the tiles of its parts. Thread-safe.
class Kernel {
 public:
  virtual ~Kernel() = default;

  [[nodiscard]] virtual std::string_view name() const = 0;
  [[nodiscard]] virtual Eigen::Index parameter_count(Eigen::Index joints) const = 0;
  [[nodiscard]] virtual Eigen::Index feature_count(Eigen::Index joints) const = 0;
  [[nodiscard]] virtual SearchBox search_box(const Eigen::MatrixXd& q) const = 0;

  /// Joint vectors (rows of `q`, rad) as features, into the first rows of a table with leading
  /// dimension `ld`.
  virtual void features(const Eigen::VectorXd& parameters, const Eigen::MatrixXd& q, double* table,
                        Eigen::Index ld) const = 0;

  /// k(x, x) of every row of `a`.
  virtual void diagonal(const Eigen::VectorXd& parameters, const FeatureBlock& a,
                        double* k) const = 0;
  /// k(i, j) of rows i of `a` and j of `b`, column-major with leading dimension `ldk` >=
  /// padded_rows(a.rows).
  virtual void tile(const Eigen::VectorXd& parameters, const FeatureBlock& a, const FeatureBlock& b,
                    double* k, Eigen::Index ldk) const = 0;
  /// gradient[p] += Σ_ij g_ij ∂k_ij/∂parameter p; `g` is laid out like `k`, zero in the padding.
  virtual void tile_gradient(const Eigen::VectorXd& parameters, const FeatureBlock& a,
                             const FeatureBlock& b, const double* g, Eigen::Index ldg,
                             double* gradient) const = 0;
  /// out[j] = Σ_i weights_i k(a_i, b_j); `weights` has zeros up to padded_rows(a.rows).
  virtual void weighted_sum(const Eigen::VectorXd& parameters, const FeatureBlock& a,
                            const FeatureBlock& b, const double* weights, double* out) const = 0;
};

using KernelPtr = std::shared_ptr<const Kernel>;

/// The kernel of one word; null when there is none.
[[nodiscard]] KernelPtr make_leaf_kernel(std::string_view word);
/// These words, for messages.
[[nodiscard]] std::string kernel_names();

/// Squared exponential (eq. 3.19, one length scale per joint) and Matérn 3/2, 5/2 (eq. 3.20): `se`,
/// `matern32`, `matern52`; null otherwise. Parameters: log length scale of each joint, rad.
[[nodiscard]] KernelPtr make_radial_kernel(std::string_view name);
/// exp(-2 Σ sin²(π (q - q') / p) / l²) (MacKay 1998). Parameters: log l of each joint (no unit),
/// then log p of each, rad.
[[nodiscard]] KernelPtr make_periodic_kernel();
/// (1 + r²/2α)^-α: squared exponentials of many scales (Rasmussen & Williams, eq. 4.19).
/// Parameters: log length scale of each joint, rad, then log α.
[[nodiscard]] KernelPtr make_rational_quadratic_kernel();
/// 1 + Σ q q' / l²: affine functions. The 1 is the variance of their value at q = 0: no joint
/// vector has a prior variance of 0. Parameters: log length scale of each joint, rad.
[[nodiscard]] KernelPtr make_linear_kernel();
/// 1 for equal joint vectors, else 0: an error that repeats at a pose but is not shared by its
/// neighbours. No parameters.
[[nodiscard]] KernelPtr make_white_kernel();

/// `inner`, one of the above, on (cos q, sin q), both with the parameters of their joint: q and q +
/// 2π are the same.
[[nodiscard]] KernelPtr make_sincos_kernel(KernelPtr inner);
/// Σ a² k with a = 1 for the first part. Parameters: those of the first part; then for each other
/// log a, and its own.
[[nodiscard]] KernelPtr sum_of(std::vector<KernelPtr> parts);
/// Π k. Parameters: those of the parts, one after the other.
[[nodiscard]] KernelPtr product_of(std::vector<KernelPtr> parts);

}  // namespace trammel
