#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <limits>
#include <optional>
#include <string>
#include <string_view>

#include "server/exchange/values.h"

/// The numbers of the figures of an answer, each with the name of its column.
namespace trammel::exchange {

/// The numbers of a figure, in the order of its columns.
[[nodiscard]] inline std::array<double, 1> numbers_of(double value) { return {value}; }
template <std::size_t N>
[[nodiscard]] const std::array<double, N>& numbers_of(const std::array<double, N>& values) {
  return values;
}
[[nodiscard]] inline std::array<double, 3> numbers_of(
    const std::optional<std::array<double, 3>>& values) {
  constexpr double kNotLearned = std::numeric_limits<double>::quiet_NaN();
  return values.value_or(std::array{kNotLearned, kNotLearned, kNotLearned});
}
[[nodiscard]] inline std::array<double, 7> numbers_of(const Pose& pose) {
  const auto& [p, q] = pose;
  return {p[0], p[1], p[2], q[0], q[1], q[2], q[3]};
}

/// Calls `take(name, number)` for each number that has a column.
template <typename Value, typename Take>
void each_column(std::string_view names, const Value& value, const Take& take) {
  for (const double number : numbers_of(value)) {
    const std::string_view name = names.substr(0, names.find(','));
    if (!name.empty()) take(std::string(name), number);
    names.remove_prefix(std::min(name.size() + 1, names.size()));
  }
}

/// As above, for the figures of an answer at this place of a table.
template <typename Figures, typename Answer, typename Take>
void each_column_at(Place place, const Figures& figures, const Answer& answer, const Take& take) {
  each_figure(figures, [&](const auto& figure) {
    if (figure.place == place) each_column(figure.columns, answer.*figure.value, take);
  });
}

}  // namespace trammel::exchange
