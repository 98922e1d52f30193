#pragma once

#include <Eigen/Dense>

namespace trammel {

/// AᵀB, m x n, of a (k x m) and b (k x n); by the fastest build that this processor runs. The same numbers on every run
/// of one machine.
[[nodiscard]] Eigen::MatrixXd transposed_product(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b);

}  // namespace trammel
