#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "server/base/result.h"

/// The dialect that spreadsheets give a table: which character separates values, and which one
/// stands before decimals. A dialect that the text does not decide is refused, never guessed.
namespace trammel {

/// Refuses what is no text: a spreadsheet (.xlsx, .ods, .xls), UTF-16, an archive. The error says
/// how to export it.
[[nodiscard]] Status check_is_text(std::string_view text, const std::string& where);

/// Where a table begins, and what separates its values.
struct CsvStart {
  char separator = ',';
  std::size_t skipped_bytes = 0;  ///< byte order mark, and a line `sep=;`
  int line = 1;                   ///< of the first byte that is not skipped
};

/// `,`, `;` or tab: what stands between the names of the header line. Where several of them do, the
/// one that the first row has as often; `sep=;` as the first line says it. Characters in double
/// quotes do not count, nor do tabs beside another separator, which are blanks. Refuses a header
/// and a first row that leave several.
[[nodiscard]] Result<CsvStart> start_of_csv(std::string_view text, const std::string& where);

/// True if a column of this name holds quantities, as tables of measurements call them: `x_mm`,
/// `Q1_DEG`, `Rx [deg]`, `qw`.
[[nodiscard]] bool holds_quantities(std::string_view column);

/// The sign before the decimals of a number: `,`, `.`, or nothing where it has none or is no
/// number.
[[nodiscard]] std::optional<char> decimal_sign(std::string_view field);

/// `1,5` as `1.5`; what has no decimal comma stays.
[[nodiscard]] std::string with_decimal_point(std::string_view field);

}  // namespace trammel
