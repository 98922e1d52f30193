#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "server/compensate/budget/budget.h"
#include "server/robot/chain.h"

namespace trammel {

/// The correction of the zero of one joint: the controller shows an angle, and the joint stands
/// `add` beyond it.
struct ZeroRemedy {
  int joint = 0;  ///< 0-based
  double add = 0, u95 = 0;
  std::string unit;  ///< `deg` or `mm`
};
/// The steps for every joint whose zero is off by more than its U.
[[nodiscard]] std::vector<ZeroRemedy> zero_remedies(const ErrorBudget& budget);

/// True if a line is put right in a step of ErrorBudget::put_right: `frames`, `zeros`, `lengths`,
/// `loads`.
[[nodiscard]] bool is_of_step(const BudgetLine& line, std::string_view step);

/// A number to set in a step, and the amount to add to its present value.
struct RemedyValue {
  std::string name;  ///< `joint 4`; otherwise the model's name
  double add = 0, u95 = 0;
  std::string unit;
};
/// The values of a step that are off by more than their U.
[[nodiscard]] std::vector<RemedyValue> remedy_values(const ErrorBudget& budget,
                                                     std::string_view step);

/// The places of zeros, lengths and load data in a maker's controller, in the maker's own words,
/// chosen by the name of the robot file. General words for an unknown maker.
struct MakersWords {
  std::string maker, zeros, lengths, load;
  std::vector<std::string> axes = {};  ///< the names of the first ones; empty: `joint 4`
  /// The maker's name of a joint (0-based): `A4`, `J4`, `axis 4`, `R`; else `joint 4`.
  [[nodiscard]] std::string axis(int joint) const;
};
[[nodiscard]] MakersWords makers_words(const Chain& robot);

/// The repairs that a shop can make, step by step, for people.
[[nodiscard]] std::vector<std::string> remedies_in_words(const ErrorBudget& budget,
                                                         const Chain& robot);

}  // namespace trammel
