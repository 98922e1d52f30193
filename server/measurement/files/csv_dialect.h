#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "server/base/result.h"

/// The dialect that a spreadsheet gives a table: the separator of values, and the decimal sign. A
/// dialect that the text does not decide is refused, never guessed.
namespace trammel {

/// Refuses files that are not text: a spreadsheet (.xlsx, .ods, .xls), UTF-16, an archive. The
/// error explains the export.
[[nodiscard]] Status check_is_text(std::string_view text, const std::string& where);

/// The start of a table, and the separator of its values.
struct CsvStart {
  char separator = ',';
  std::size_t skipped_bytes = 0;  ///< byte order mark, and a line `sep=;`
  int line = 1;                   ///< of the first byte of the table
};

/// Finds the separator of the header line: `,`, `;` or tab. If several occur, it is the one that
/// occurs equally often in the first row; a first line `sep=;` decides. Characters in double quotes
/// do not count. Tabs beside another separator count as blanks. Refuses a header and a first row
/// that leave several candidates.
[[nodiscard]] Result<CsvStart> start_of_csv(std::string_view text, const std::string& where);

/// True if a column of this name holds quantities, by the names that tables of measurements use:
/// `x_mm`, `Q1_DEG`, `Rx [deg]`, `qw`.
[[nodiscard]] bool holds_quantities(std::string_view column);

/// The decimal sign of a number: `,` or `.`. Empty if the field has no decimals or is not a number.
[[nodiscard]] std::optional<char> decimal_sign(std::string_view field);

/// `1,5` becomes `1.5`; a field without a decimal comma is unchanged.
[[nodiscard]] std::string with_decimal_point(std::string_view field);

}  // namespace trammel
