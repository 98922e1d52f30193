#pragma once

#include <Eigen/Dense>
#include <memory>
#include <vector>

namespace trammel::cause_search {

/// L⁻¹ of an information matrix L Lᵀ.
[[nodiscard]] Eigen::MatrixXd inverse_factor_of(const Eigen::MatrixXd& information);

/// The expectation for whitened rows when no candidate acts: white noise of unit variance, and
/// `columns` Z times unknown numbers of unit variance. The columns are the model's own parameters,
/// in units of their priors, and the anonymous functions found before. The covariance of the rows
/// is S = 1 + Z Zᵀ. By the matrix inversion lemma S⁻¹ = 1
/// - U Uᵀ with U = Z L⁻ᵀ and 1 + ZᵀZ = L Lᵀ.
class Background {
 public:
  explicit Background(Eigen::MatrixXd columns);
  /// The background with 1 + ZᵀZ known.
  Background(Eigen::MatrixXd columns, Eigen::MatrixXd information);

  /// S⁻¹ y of every column.
  [[nodiscard]] Eigen::MatrixXd project(const Eigen::MatrixXd& y) const;
  /// The background of its columns at `places` alone.
  [[nodiscard]] Background part(const std::vector<Eigen::Index>& places) const;
  /// R x p: U, worked out when it is first asked for, by one thread.
  [[nodiscard]] const Eigen::MatrixXd& root() const;
  /// R x p: Z.
  [[nodiscard]] const Eigen::MatrixXd& columns() const { return columns_; }
  /// p x k: posterior means of the unknown numbers, given each column of y.
  [[nodiscard]] Eigen::MatrixXd estimate(const Eigen::MatrixXd& y) const;
  /// p x p: their posterior covariance, whatever y is.
  [[nodiscard]] Eigen::MatrixXd covariance() const;
  /// The same for this background and its copies, and for no other one.
  [[nodiscard]] const std::shared_ptr<const int>& identity() const { return identity_; }

 private:
  Eigen::MatrixXd columns_;
  Eigen::MatrixXd information_;  // 1 + ZᵀZ
  Eigen::MatrixXd inverse_;      // L⁻¹
  mutable Eigen::MatrixXd root_;
  std::shared_ptr<const int> identity_ = std::make_shared<const int>();
};

}  // namespace trammel::cause_search
