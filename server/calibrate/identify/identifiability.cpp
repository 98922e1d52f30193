#include "server/calibrate/identify/identifiability.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace trammel {

namespace {

std::string joined(const std::vector<std::string>& names) {
  std::string text;
  for (std::size_t i = 0; i < names.size(); ++i) {
    text += (i == 0 ? "" : i + 1 == names.size() ? " and " : ", ") + names[i];
  }
  return text;
}

/// Combines the null directions (columns, typical units) so that each has few parameters: Gaussian
/// elimination with complete pivoting, after which each direction has a parameter of its own.
Eigen::MatrixXd disentangled(Eigen::MatrixXd directions) {
  for (Eigen::Index done = 0; done < directions.cols(); ++done) {
    Eigen::Index row = 0;
    Eigen::Index column = 0;
    directions.rightCols(directions.cols() - done).cwiseAbs().maxCoeff(&row, &column);
    directions.col(done).swap(directions.col(done + column));
    directions.col(done) /= directions(row, done);
    for (Eigen::Index other = 0; other < directions.cols(); ++other) {
      if (other != done) directions.col(other) -= directions(row, other) * directions.col(done);
    }
  }
  return directions;
}

/// `direction` in typical units; `strength` of each parameter alone, in prior units.
UnidentifiableCombination in_words(double singular_value, const Eigen::VectorXd& direction,
                                   const std::vector<Parameter>& parameters,
                                   const Eigen::VectorXd& strength) {
  constexpr double kMatters = 0.1;  // of the largest part: smaller ones are not worth naming
  std::vector<std::size_t> order(parameters.size());
  std::iota(order.begin(), order.end(), 0u);
  const auto weight = [&](std::size_t i) {
    return std::abs(direction(static_cast<Eigen::Index>(i)));
  };
  // Parts that are equal up to rounding stay in the order of the parameters: sentences must not
  // depend on the last bit.
  const auto rank = [&](std::size_t i) { return std::lround(1e3 * weight(i)); };
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return rank(a) > rank(b); });
  UnidentifiableCombination combination;
  combination.singular_value = singular_value;
  for (const std::size_t i : order) {
    if (weight(i) >= kMatters * weight(order.front()))
      combination.parameters.push_back(parameters[i].name);
  }
  const std::string names = joined(combination.parameters);
  if (combination.parameters.size() > 1) {
    // Parameters of an anchor or of a zero of an instrument, `ax[a1]`, `zero[a1]`, move no tool.
    const bool instruments = std::any_of(
        combination.parameters.begin(), combination.parameters.end(), [](const std::string& name) {
          return name.starts_with("zero[") || (name.size() > 3 && name[0] == 'a' && name[2] == '[');
        });
    combination.sentence =
        fmt::format("{} {} the same way at these poses: only a combination of them is known", names,
                    instruments ? "change what is measured" : "move the tool");
  } else if (strength(static_cast<Eigen::Index>(order.front())) < 1) {
    combination.sentence =
        fmt::format("{}: these poses do not show it; it stays at its prior", names);
  } else {
    combination.sentence = fmt::format(
        "{}: several other parameters together move the tool the same way at these poses; it stays "
        "at its prior",
        names);
  }
  return combination;
}

}  // namespace

std::vector<UnidentifiableCombination> unidentifiable_combinations(
    const Information& seen, const std::vector<Parameter>& parameters,
    const Eigen::VectorXd& to_typical) {
  const auto unseen = (seen.singular_values.array() < 1).count();  // ascending: the first ones
  if (unseen == 0) return {};
  const Eigen::VectorXd strength = (seen.singular_values.asDiagonal() * seen.directions.transpose())
                                       .colwise()
                                       .norm()
                                       .transpose();
  const Eigen::MatrixXd directions =
      disentangled(to_typical.asDiagonal() * seen.directions.leftCols(unseen));
  std::vector<UnidentifiableCombination> combinations;
  for (Eigen::Index k = 0; k < unseen; ++k) {
    const Eigen::VectorXd in_prior_units = directions.col(k).cwiseQuotient(to_typical).normalized();
    const double value =
        (seen.singular_values.asDiagonal() * seen.directions.transpose() * in_prior_units).norm();
    combinations.push_back(in_words(value, directions.col(k), parameters, strength));
  }
  return combinations;
}

}  // namespace trammel
