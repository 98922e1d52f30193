#pragma once

#include <Eigen/Dense>
#include <vector>

namespace trammel {

/// The rows of `table` (N x n) in parts of at most `most` neighbours each. A part that is too large is halved across
/// the column in which it spreads widest, again and again. The indices in a part rise.
[[nodiscard]] std::vector<std::vector<Eigen::Index>> halved(const Eigen::MatrixXd& table, Eigen::Index most);

}  // namespace trammel
