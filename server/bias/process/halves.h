#pragma once

#include <Eigen/Dense>
#include <vector>

namespace trammel {

/// The rows of `table`, N x n, in parts of neighbours of at most `most` rows each: halved across the column that
/// spreads widest in a part, again and again. The rows of a part rise.
[[nodiscard]] std::vector<std::vector<Eigen::Index>> halved(const Eigen::MatrixXd& table, Eigen::Index most);

}  // namespace trammel
