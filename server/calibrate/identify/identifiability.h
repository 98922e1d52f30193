#pragma once

#include <Eigen/Dense>
#include <string>
#include <vector>

#include "server/error_sources/error_source.h"

namespace trammel {

/// What the data say of the parameters, in units of their priors: right singular vectors and singular values of the
/// whitened Jacobian, smallest first.
struct Information {
  Eigen::VectorXd singular_values;
  Eigen::MatrixXd directions;  ///< columns
};

/// A direction in parameter space that the data do not show (singular value below 1 in prior units).
struct UnidentifiableCombination {
  double singular_value = 0;
  std::vector<std::string> parameters;  ///< those that matter in it, largest first
  std::string sentence;                 ///< for people
};

/// Every direction that the data do not show, told apart into as few parameters each as possible, in words.
/// `to_typical` turns prior units into units in which people compare parameters.
[[nodiscard]] std::vector<UnidentifiableCombination> unidentifiable_combinations(
    const Information& seen, const std::vector<Parameter>& parameters, const Eigen::VectorXd& to_typical);

}  // namespace trammel
