#pragma once

#include <string>
#include <vector>

namespace trammel::hidden {

/// A batch's text without these columns: each word means all columns that begin with it.
[[nodiscard]] std::string without_columns(const std::string& csv,
                                          const std::vector<std::string>& beginnings);

/// `csv` with `change` added to the field of that column in that row (from 0).
[[nodiscard]] std::string with_added(const std::string& csv, const std::string& column, int row,
                                     double change);

}  // namespace trammel::hidden
