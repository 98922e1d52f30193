#pragma once

#include <Eigen/Dense>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "server/bias/kernels/kernel.h"
#include "server/bias/process/variance_table.h"
#include "server/numerics/aligned_matrix.h"

namespace trammel {

/// The variance that a process leaves, from a few directions of its data for each region of joint space: what many
/// points say of one region has few independent parts.
///
/// With G the inverse root of M and t = G k(points, x), the variance left is k(x, x) - |t|². Let Q have orthonormal
/// columns that span t nearly, for all x of a region. By Bessel's inequality |Qᵀt|² <= |t|², so k(x, x) - |P k|² with
/// P = QᵀG is never below the exact variance, wherever x is. Only the points with the largest covariance with the
/// region are used: leaving out others raises the variance, too. P is kept in single precision; it is scaled so that
/// rounding cannot make P M Pᵀ exceed the identity.
///
/// What that leaves out is checked for each target. From 24 sets of data y ~ N(0, M), drawn once, follow posterior
/// means at x: yᵀM⁻¹k exactly, and (P y)ᵀ(P k). Their mean square difference is an unbiased estimate of |t|² - |P k|².
/// Where it is too large the target gets the exact variance.
///
/// A region is worked out when the first target falls into it, in some milliseconds, always with the same result.
/// Thread-safe.
class RegionalVariance {
 public:
  /// `q`: N x n, rad; `noise`: N, relative to σ_f². `tolerance`: by what share of itself the standard deviation of a
  /// measurement may be too large at the samples that a region is worked out from; at a target it is let be too large
  /// by twice as much.
  RegionalVariance(KernelPtr kernel, Eigen::VectorXd parameters, Eigen::MatrixXd q, Eigen::VectorXd noise,
                   double tolerance);

  /// As VarianceTable::shares(); the same as `exact`, which is that of all points, where a region would need too many
  /// directions, and at targets that it does not stand for.
  void shares(const VarianceTable& exact, const FeatureBlock& targets, double* posterior, double* prior) const;

  /// Works out what is not worked out yet of region `index`.
  void prepare(const VarianceTable& exact, std::size_t index) const;
  [[nodiscard]] std::size_t regions() const { return centres_.size(); }

 private:
  /// A matrix in single precision, as Numerics packs it.
  struct Panels {
    Eigen::Index rows = 0, cols = 0;
    std::vector<float> packed;
  };
  struct Region {
    std::once_flag built;
    bool exact = true;  // P is not worth it
    std::vector<Eigen::Index> points;
    Panels P;
    double factor = 1;        // of |P k|², at most 1
    Eigen::MatrixXd checked;  // P y: what P makes of each of the data that were drawn
  };
  struct Fit;

  [[nodiscard]] static Panels packed(const Eigen::MatrixXd& a);
  [[nodiscard]] AlignedMatrix features_of(const Eigen::MatrixXd& q) const;
  [[nodiscard]] AlignedMatrix features_at(const std::vector<Eigen::Index>& points) const;
  [[nodiscard]] std::vector<std::size_t> regions_of(const FeatureBlock& targets) const;
  /// A joint vector as it may be asked for: a training pose, near one, between two, or anywhere in their range.
  [[nodiscard]] Eigen::VectorXd sample(std::size_t number) const;
  [[nodiscard]] Eigen::MatrixXd samples_in(std::size_t region) const;
  /// The points by what they have in common with the samples, most first.
  [[nodiscard]] std::vector<Eigen::Index> ranked(const AlignedMatrix& samples, Eigen::Index count) const;
  /// Empty where M of these points is not positive definite.
  [[nodiscard]] std::unique_ptr<Fit> fit(const std::vector<Eigen::Index>& points, const AlignedMatrix& samples,
                                         Eigen::Index count) const;
  [[nodiscard]] AlignedMatrix covariance_of(const Fit& fit) const;
  /// Of the fit, the directions that the samples need, as rows of P; empty where they are too many.
  [[nodiscard]] Eigen::MatrixXd directions(const Fit& fit) const;
  void keep(const Fit& fit, const Eigen::MatrixXd& P, Region* region) const;
  void build(std::size_t index) const;
  void draw_data(const VarianceTable& exact) const;
  void assign_samples() const;
  /// The variance left of a target with these covariances with all points; empty where the exact one must tell.
  [[nodiscard]] std::optional<double> left_of(const Region& region, const double* k, double prior) const;

  KernelPtr kernel_;
  Eigen::VectorXd parameters_;
  Eigen::MatrixXd q_;
  Eigen::VectorXd low_, high_;  // the range of q, rad, with a margin
  Eigen::VectorXd noise_;
  double tolerance_;
  AlignedMatrix features_;
  std::vector<Eigen::Index> centres_;  // of each region, the point in its middle
  AlignedMatrix centre_features_;
  std::unique_ptr<Region[]> all_;
  mutable std::once_flag drawn_;
  mutable std::vector<std::vector<std::size_t>> samples_;  // of each region, their numbers
  mutable Eigen::MatrixXd data_;                           // y, N x kDrawn
  mutable Panels weights_;                                 // M⁻¹ y, transposed
};

}  // namespace trammel
