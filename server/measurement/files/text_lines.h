#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "server/measurement/files/csv_table.h"

/// Splits the text files of other programs into lines and fields.
namespace trammel {

constexpr std::size_t kLongestLine = 65'536;  ///< bytes

struct TextLine {
  int number = 0;  ///< from 1
  std::string_view text;
  bool comment = false;  ///< starts with `//` or `#`; `text` is then the rest
};

/// The lines that are not empty, without surrounding blanks; LF or CRLF, with or without byte order
/// mark. Refuses binary data. Refuses as kTooLarge more than a million lines, 100,000 lines of
/// data, and a line longer than `longest` bytes.
[[nodiscard]] Result<std::vector<TextLine>> text_lines(std::string_view text,
                                                       const std::string& where,
                                                       std::size_t longest = kLongestLine);
/// The first lines of data, `count` at most, without comments.
[[nodiscard]] std::vector<TextLine> first_lines(std::string_view text, std::size_t count);

/// The first of `;`, tab and `,` that is in the line. It is ' ' if none is, if all commas are
/// decimal commas between blanks, or if a tab separates two lists of numbers with blanks between
/// them.
[[nodiscard]] char separator_of(std::string_view line);

/// The fields of a line, without blanks around them; `' '` separates by any run of blanks. A field
/// in double quotes may hold separators.
[[nodiscard]] std::vector<std::string> split_fields(std::string_view line, char separator);

/// The lines of data as rows. Refuses as kTooLarge more values than a table may hold, while it
/// splits.
[[nodiscard]] Result<std::vector<CsvTable::Row>> data_rows(const std::vector<TextLine>& lines,
                                                           char separator,
                                                           const std::string& where);

[[nodiscard]] bool is_number(std::string_view field);

/// A column name as programs write it: `X (mm)`, `J1 [deg]`, `x_mm`.
struct ColumnName {
  std::string name;  ///< lower case, letters and digits only
  std::string unit;  ///< lower case; longer spellings become deg, rad and in; empty: none given
};
[[nodiscard]] ColumnName column_name(std::string_view field);
/// The joint that a column_name() names, from 1: `j3`, `joint3`, `axis3`, `a3`, `q3`, and in other
/// languages `achse3`, `axe3`, `asse3`, `eje3`, `gelenk3`, `theta3`. 0 appears in files that count
/// from 0. Empty for other names, and beyond 12 joints.
[[nodiscard]] std::optional<int> joint_number(std::string_view name);

}  // namespace trammel
