#pragma once

#include <Eigen/Dense>
#include <optional>
#include <utility>
#include <vector>

namespace trammel {

/// L⁻¹ of a covariance M = L Lᵀ, stored row after row. A point is added or removed in N²
/// operations.
class InverseRoot {
 public:
  /// `rows`: row i has i + 1 entries.
  InverseRoot(std::vector<double> rows, Eigen::Index size) : size_(size), rows_(std::move(rows)) {}

  [[nodiscard]] Eigen::Index size() const { return size_; }
  /// Row i: i + 1 entries.
  [[nodiscard]] Eigen::Map<const Eigen::VectorXd> row(Eigen::Index i) const;

  /// Adds a point, given its variance and its covariance with the others; returns the new last row.
  /// Empty, without any change, if M would no longer be positive definite.
  [[nodiscard]] std::optional<Eigen::VectorXd> append(const Eigen::VectorXd& covariance,
                                                      double variance);

  /// Takes row and column `point` out of M. Returns r with (M⁻¹ before) = (M⁻¹ after) + r rᵀ; r has
  /// the length that rows had before.
  Eigen::VectorXd remove(Eigen::Index point);

  [[nodiscard]] const std::vector<double>& rows() const { return rows_; }

 private:
  [[nodiscard]] Eigen::Map<Eigen::VectorXd> mutable_row(Eigen::Index i);

  Eigen::Index size_ = 0;
  std::vector<double> rows_;
};

}  // namespace trammel
