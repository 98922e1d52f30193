#pragma once

#include <Eigen/Dense>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "server/base/result.h"

namespace trammel {

/// Text in columns with a header line: UTF-8 with or without byte order mark, lines that end with
/// LF or CRLF. `#` lines are comments, and fields may be quoted. The separator is `,`, `;` or tab,
/// as found in the header (csv_dialect.h); with `;` or tab a number may have a decimal comma. Rows
/// without any value are skipped. Rows are counted from 0; messages name the line in the file.
class CsvTable {
 public:
  static constexpr std::size_t kMostRows = 1'000'000;
  static constexpr std::size_t kMostColumns = 1000;
  static constexpr std::size_t kMostValues =
      5'000'000;  ///< of a table: each takes 32 bytes at least

  /// Refuses binary data, a text without header, a column without a name or with a repeated name, a
  /// row of another length than the header, an open quote, bytes that are not UTF-8, and control
  /// characters. Refuses ambiguous texts: commas both between values and in numbers, or decimal
  /// points beside decimal commas. Refuses as kTooLarge more than `most_rows`, 1000 columns, 5
  /// million values or 64 KiB in one value; it stops reading there and keeps nothing beyond.
  [[nodiscard]] static Result<CsvTable> parse(std::string_view text, std::string where,
                                              std::size_t most_rows = kMostRows);
  /// A row that another reader has split at `separator`. A table made of such rows has the same
  /// checks and messages. Refuses as parse() does.
  struct Row {
    int line = 0;
    std::vector<std::string> fields;
  };
  [[nodiscard]] static Result<CsvTable> from_rows(std::string where, const Row& header,
                                                  const std::vector<Row>& rows,
                                                  char separator = ',');

  [[nodiscard]] const std::string& where() const { return where_; }
  [[nodiscard]] const std::vector<std::string>& columns() const { return columns_; }
  [[nodiscard]] std::size_t size() const { return rows_.size(); }
  [[nodiscard]] int line(std::size_t row) const { return rows_[row].line; }

  /// The column of this name. If there is none, the only column that differs from it in upper and
  /// lower case alone.
  [[nodiscard]] std::optional<std::size_t> find(std::string_view column) const;
  /// Refuses a missing column; the error names a similar one, and lists the columns of the file.
  [[nodiscard]] Result<std::size_t> require(std::string_view column) const;
  /// The numbers of all `columns`; empty if the file has none of them. Refuses a part of them.
  [[nodiscard]] Result<std::vector<std::size_t>> all_or_none(
      const std::vector<std::string>& columns) const;

  [[nodiscard]] const std::string& field(std::size_t row, std::size_t column) const {
    return rows_[row].fields[column];
  }
  /// An id or a name, which may be empty. Refuses the same as check_name() (plain_text.h).
  [[nodiscard]] Result<std::string> name(std::size_t row, std::size_t column) const;
  /// Refuses values other than finite numbers of magnitude <= `limit`.
  [[nodiscard]] Result<double> number(std::size_t row, std::size_t column,
                                      double limit = 1e12) const;
  [[nodiscard]] Result<int> integer(std::size_t row, std::size_t column, int lowest,
                                    int highest) const;
  /// A rotation matrix from a unit quaternion in four columns w, x, y, z. Its length may differ
  /// from 1 by 1e-3.
  [[nodiscard]] Result<Eigen::Matrix3d> rotation(std::size_t row,
                                                 const std::vector<std::size_t>& wxyz) const;
  /// An error with the file and the line of the row.
  template <typename... Args>
  [[nodiscard]] Failure refuse(std::size_t row, fmt::format_string<Args...> text,
                               Args&&... args) const {
    return refused(text, std::forward<Args>(args)...).in(where_).at_row(line(row));
  }

 private:
  [[nodiscard]] Status set_columns(Row header);
  [[nodiscard]] Status add_row(Row row);
  /// Writes decimal commas as points, so that all readers of a field see one spelling.
  [[nodiscard]] Status settle_decimals();

  std::string where_;
  std::vector<std::string> columns_;
  std::vector<Row> rows_;
  std::size_t most_rows_ = kMostRows;
  char separator_ = ',';
  bool points_ = false;  // some quantity has a decimal point
};

/// The field as it is written to a file, in quotes if necessary.
[[nodiscard]] std::string csv_field(std::string_view text);
/// The shortest decimal form that keeps 12 digits.
[[nodiscard]] std::string csv_number(double value);

}  // namespace trammel
