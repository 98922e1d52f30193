#pragma once

#include <Eigen/Dense>
#include <optional>

/// Products and factors of Eigen matrices by the fastest build that this processor runs. The same
/// numbers on every run of one machine.
namespace trammel {

/// AᵀB, m x n, of a (k x m) and b (k x n).
[[nodiscard]] Eigen::MatrixXd transposed_product(const Eigen::MatrixXd& a,
                                                 const Eigen::MatrixXd& b);

/// AᵀA, n x n, of a (k x n), in half the operations of a product of two.
[[nodiscard]] Eigen::MatrixXd gram(const Eigen::MatrixXd& a);

/// A Lᵀ, k x n, of a (k x n) and the lower triangle of l (n x n), in half the operations.
[[nodiscard]] Eigen::MatrixXd times_lower_transposed(const Eigen::MatrixXd& a,
                                                     const Eigen::MatrixXd& l);

/// L⁻¹, lower triangular with zeros above, of a symmetric m = L Lᵀ. Reads the lower triangle of m
/// only. Empty where m is not positive definite.
[[nodiscard]] std::optional<Eigen::MatrixXd> inverse_factor(const Eigen::MatrixXd& m);

}  // namespace trammel
