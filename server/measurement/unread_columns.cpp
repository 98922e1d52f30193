#include "server/measurement/unread_columns.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <optional>

#include "server/measurement/files/text_lines.h"
#include "server/robot/three_numbers.h"

namespace trammel {

namespace {

using Three = std::array<std::string, 3>;

const std::array<Three, 4> kDirections = {
    {{"i", "j", "k"}, {"u", "v", "w"}, {"nx", "ny", "nz"}, {"vx", "vy", "vz"}}};

/// True if all fields of the column are numbers, and at least two differ.
bool holds_numbers(const MeasurementBatch& batch, std::size_t column) {
  const std::string* first = nullptr;
  bool differ = false;
  for (const Measurement& m : batch.measurements) {
    if (column >= m.extra.size() || m.extra[column].empty()) continue;
    if (!is_number(m.extra[column])) return false;
    if (first == nullptr) first = &m.extra[column];
    differ = differ || m.extra[column] != *first;
  }
  return differ;
}

/// The columns with these names, as written in the file; empty if one is missing.
std::vector<std::string> columns_of(const std::vector<std::string>& columns, const Three& names) {
  std::vector<std::string> found;
  for (const std::string& name : names)
    for (const std::string& column : columns)
      if (column_name(column).name == name) found.push_back(column);
  return found.size() == names.size() ? found : std::vector<std::string>{};
}

/// Explains how to name the columns that makers use for an orientation; empty if there are none.
std::string orientation_among(const std::vector<std::string>& columns) {
  for (const ThreeNumbers& way : ways_of_three_numbers()) {
    for (const Three& names : way.columns) {
      const auto three = columns_of(columns, names);
      if (three.empty()) continue;
      const auto& rotation_vector =
          names[0] == "rx" ? " or, of Universal Robots, rvx_rad, rvy_rad, rvz_rad" : "";
      return fmt::format(
          "; {} look like an orientation: name them {}_deg, {}_deg, {}_deg{} (or _rad) where they "
          "are {}, in the file or by trammel convert --table FILE --columns",
          fmt::join(three, ", "), names[0], names[1], names[2], rotation_vector,
          way.meaning.empty() ? way.name : way.meaning);
    }
  }
  return "";
}

std::string direction_among(const std::vector<std::string>& columns) {
  for (const Three& names : kDirections) {
    const auto three = columns_of(columns, names);
    if (!three.empty())
      return fmt::format(
          "; {} look like a direction, which tells no turn about itself: only a "
          "whole orientation is used (qw, qx, qy, qz)",
          fmt::join(three, ", "));
  }
  return "";
}

}  // namespace

std::string unread_columns(const MeasurementBatch& batch, const std::vector<std::string>& told) {
  std::vector<std::string> unread;
  for (std::size_t k = 0; k < batch.extra_columns.size(); ++k) {
    const std::string& column = batch.extra_columns[k];
    if (std::find(told.begin(), told.end(), column) == told.end() && holds_numbers(batch, k))
      unread.push_back(column);
  }
  if (unread.empty()) return "";
  std::string what = orientation_among(unread) + direction_among(unread);
  if (what.empty())
    what =
        "; where one of them was measured of the pose, give it the name that such columns have "
        "(trammel help formats), in the file or by trammel convert --table FILE --columns";
  const bool one = unread.size() == 1;
  return fmt::format("{} {} {} numbers and {} not used: nothing is learned from {}{}",
                     one ? "column" : "columns", fmt::join(unread, ", "), one ? "holds" : "hold",
                     one ? "is" : "are", one ? "it" : "them", what);
}

}  // namespace trammel
