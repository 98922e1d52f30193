#pragma once

#include <string>
#include <string_view>
#include <vector>

/// Splits the text files of other programs into lines and fields.
namespace trammel {

struct TextLine {
  int number = 0;  ///< from 1
  std::string_view text;
  bool comment = false;  ///< starts with `//` or `#`; `text` is then what follows
};

/// The lines that are not empty, without blanks around them; LF or CRLF, with or without byte order mark.
[[nodiscard]] std::vector<TextLine> text_lines(std::string_view text);

/// `;`, tab or `,`, whichever of them comes first in this list and is in the line; ' ' where none is.
[[nodiscard]] char separator_of(std::string_view line);

/// The fields of a line, without blanks around them; `' '` separates by any run of blanks. A field in double quotes may
/// hold separators.
[[nodiscard]] std::vector<std::string> split_fields(std::string_view line, char separator);

[[nodiscard]] bool is_number(std::string_view field);

/// A column name as programs write it: `X (mm)`, `J1 [deg]`, `x_mm`.
struct ColumnName {
  std::string name;  ///< lower case, letters and digits only
  std::string unit;  ///< lower case; longer spellings become deg, rad and in; empty: none given
};
[[nodiscard]] ColumnName column_name(std::string_view field);

}  // namespace trammel
