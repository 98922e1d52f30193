#pragma once

#include <map>
#include <string>
#include <vector>

/// Short texts for tables and notes: a target that stands in its motion has no name of its own, and
/// what holds for many is said once.
namespace trammel::cam {

/// True for a name that is the text of a target, `[[1800,...],...]` or `p[...]` or `{X 1800,...}`,
/// or contains one.
[[nodiscard]] bool is_text_of_target(const std::string& name);
/// `point 3 at line 12`: the third such target of its file.
[[nodiscard]] std::string short_name(int ordinal, int line);

/// Gives `shown` to each row, in their order; rows of a receipt and of a prediction alike.
template <typename Row>
void shorten_names(std::vector<Row>& rows) {
  std::map<std::string, int> counts;  // by file
  for (Row& row : rows)
    row.shown = is_text_of_target(row.name) ? short_name(++counts[row.file], row.line) : row.name;
}

/// The name of a row for people and tables.
template <typename Row>
[[nodiscard]] const std::string& shown_name(const Row& row) {
  return row.shown.empty() ? row.name : row.shown;
}

/// Equal sentences once, with their number: `... (31 times)`.
[[nodiscard]] std::vector<std::string> counted(const std::vector<std::string>& sentences);

}  // namespace trammel::cam
