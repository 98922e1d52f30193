#pragma once

#include <Eigen/Dense>
#include <string>
#include <vector>

#include "server/error_sources/error_source.h"

namespace trammel {

/// The information of the data about the parameters: singular values and right singular vectors of
/// the Jacobian in units of sigma and of the priors, smallest first.
struct Information {
  Eigen::VectorXd singular_values;
  Eigen::MatrixXd directions;  ///< columns
};

/// A direction in parameter space that the data do not show (singular value below 1 in prior
/// units).
struct UnidentifiableCombination {
  double singular_value = 0;
  std::vector<std::string> parameters;  ///< parameters with a large part in it, largest first
  std::string sentence;                 ///< for people
};

/// Describes all directions that the data do not show in words, each with as few parameters as
/// possible. `to_typical` converts prior units into comparable units for parameters of one kind.
[[nodiscard]] std::vector<UnidentifiableCombination> unidentifiable_combinations(
    const Information& seen, const std::vector<Parameter>& parameters,
    const Eigen::VectorXd& to_typical);

}  // namespace trammel
