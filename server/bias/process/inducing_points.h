#pragma once

#include <Eigen/Dense>
#include <optional>
#include <vector>

#include "server/bias/kernels/kernel.h"
#include "server/bias/process/variance_table.h"
#include "server/numerics/aligned_matrix.h"

/// A Gaussian process approximated by a few of its points, u. The part of the other points that u
/// does not explain counts as unknown and independent of the data (deterministic training
/// conditional; Quiñonero-Candela & Rasmussen, JMLR 6, 2005).
namespace trammel {

/// Points that leave at most `tolerance` of the prior variance of any point unexplained, the most
/// telling first, `most` at most. Chosen among the `count` rows of `features` by pivoted Cholesky
/// (Harbrecht, Peters, Schneider 2012).
[[nodiscard]] std::vector<Eigen::Index> spanning_points(const Kernel& kernel,
                                                        const Eigen::VectorXd& parameters,
                                                        const AlignedMatrix& features,
                                                        Eigen::Index count, double tolerance,
                                                        Eigen::Index most);

/// With W = chol(R_uu)⁻¹, φ(x) = W k(u, x), D the noise relative to σ_f²: B = I + Σ_i φ_i φ_iᵀ /
/// D_i,
///   mean(x) = φᵀ B⁻¹ Σ_i φ_i y_i / D_i,
///   share(x) = k(x, x) - φᵀφ + φᵀ B⁻¹ φ = k(x, x) - |G k(u, x)|².
/// Learns in blocks of any size, with memory for B only, however many points there are. For one
/// thread at a time.
class InducingPoints {
 public:
  /// Empty where points are so close to each other that R_uu is not positive definite.
  [[nodiscard]] static std::optional<InducingPoints> at(const Kernel& kernel,
                                                        const Eigen::VectorXd& parameters,
                                                        const AlignedMatrix& features,
                                                        const std::vector<Eigen::Index>& rows);

  /// `block` is followed by its padding, as in Kernel; `noise` (D) and `y` have block.rows entries.
  void learn(const Kernel& kernel, const Eigen::VectorXd& parameters, const FeatureBlock& block,
             const Eigen::VectorXd& noise, const Eigen::VectorXd& y);

  struct Posterior {
    VarianceTable variance;
    Eigen::VectorXd weights;   ///< mean(x) = weights · k(u, x)
    Eigen::VectorXd response;  ///< B⁻¹ Σ φ y / D
    AlignedMatrix inverse;     ///< -B⁻¹, lower triangle
    double log_det = 0;        ///< of B
    double quadratic = 0;      ///< yᵀ (ΦΦᵀ + D)⁻¹ y
  };
  [[nodiscard]] std::optional<Posterior> posterior() const;

  /// φ of each row of `block`, a column each, r x block.rows with padding.
  [[nodiscard]] AlignedMatrix basis(const Kernel& kernel, const Eigen::VectorXd& parameters,
                                    const FeatureBlock& block) const;

  [[nodiscard]] Eigen::Index size() const { return size_; }
  [[nodiscard]] const AlignedMatrix& features() const { return features_; }
  /// W, zero above the diagonal and in the padding.
  [[nodiscard]] const AlignedMatrix& root() const { return root_; }

 private:
  InducingPoints() = default;

  Eigen::Index size_ = 0;
  AlignedMatrix features_;  // of u, padded
  AlignedMatrix root_;      // W, lower triangle, zero elsewhere
  AlignedMatrix normal_;    // B, lower triangle; tiles across the diagonal are filled
  Eigen::VectorXd moment_;  // Σ φ y / D
  double square_ = 0;       // Σ y² / D
};

}  // namespace trammel
