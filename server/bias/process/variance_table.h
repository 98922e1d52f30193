#pragma once

#include <Eigen/Dense>
#include <vector>

#include "server/bias/kernels/kernel.h"
#include "server/numerics/aligned_matrix.h"

namespace trammel {

/// Variance of the function at one joint vector, m².
struct PosteriorVariance {
  double posterior;
  double prior;
};

/// The variance that some points leave: prior - |G k(points, x)|², G lower triangular.
class VarianceTable {
 public:
  VarianceTable() = default;
  /// `features` of `size` points, padded; `root` holds G in its lower triangle.
  VarianceTable(AlignedMatrix features, Eigen::Index size, AlignedMatrix root);

  /// For each row of `targets` (features) the variance left and the prior k(x, x), both in units of σ_f² and
  /// targets.rows long.
  void shares(const Kernel& kernel, const Eigen::VectorXd& parameters, const FeatureBlock& targets, double* posterior,
              double* prior) const;

  [[nodiscard]] Eigen::Index size() const { return size_; }
  /// The same, G row after row, row i of i + 1 entries.
  VarianceTable(AlignedMatrix features, Eigen::Index size, const std::vector<double>& rows);
  /// G row after row, with room for `more` rows.
  [[nodiscard]] std::vector<double> rows(Eigen::Index more) const;
  /// Multiplies every posterior variance by `factor`, up to the prior.
  void widen(double factor) { factor_ *= factor; }

 private:
  AlignedMatrix features_;
  Eigen::Index size_ = 0;
  AlignedMatrix packed_root_;
  double factor_ = 1.0;
};

}  // namespace trammel
