#pragma once

#include <Eigen/Dense>
#include <memory>
#include <vector>

#include "server/bias/kernels/kernel.h"
#include "server/numerics/aligned_matrix.h"

namespace trammel {

/// Variance of the function at one joint vector, m².
struct PosteriorVariance {
  double posterior;
  double prior;
};

/// Features of points, padded. All computations with these points share them.
using PointFeatures = std::shared_ptr<const AlignedMatrix>;

/// The variance that some points leave: prior - |G k(points, x)|², G lower triangular.
class VarianceTable {
 public:
  VarianceTable() = default;
  /// `features` of `size` points; `root` holds G in its lower triangle.
  VarianceTable(PointFeatures features, Eigen::Index size, AlignedMatrix root);
  /// A table from G row after row, row i of i + 1 entries.
  VarianceTable(PointFeatures features, Eigen::Index size, const std::vector<double>& rows);
  /// The table with G rounded to single precision: half the memory, half the time. Each variance
  /// is larger by `rounding` (in units of σ_f²), so that it is not below the exact one.
  [[nodiscard]] VarianceTable in_single_precision(double rounding) const;

  /// For each row of `targets` (features) the variance left and the prior k(x, x), both in units of
  /// σ_f² and targets.rows long.
  void shares(const Kernel& kernel, const Eigen::VectorXd& parameters, const FeatureBlock& targets,
              double* posterior, double* prior) const;

  [[nodiscard]] Eigen::Index size() const { return size_; }
  /// G row after row, with room for `more` rows; not of a table in single precision.
  [[nodiscard]] std::vector<double> rows(Eigen::Index more) const;
  /// Multiplies every posterior variance by `factor` and adds `more` (in units of σ_f²), up to the
  /// prior.
  void widen(double factor, double more = 0.0) {
    factor_ *= factor;
    added_ = factor * added_ + more;
  }

 private:
  void square_norms(Eigen::Index count, const double* k, double* out) const;

  PointFeatures features_;
  Eigen::Index size_ = 0;
  AlignedMatrix packed_root_;  // in the packed form of Numerics; floats if is_single_
  bool is_single_ = false;
  double factor_ = 1.0;
  double added_ = 0.0;
};

}  // namespace trammel
