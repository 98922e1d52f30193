#pragma once

#include <Eigen/Dense>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "server/base/result.h"

namespace trammel {

/// Comma-separated text with a header line: UTF-8 with or without byte order mark, lines ended by LF or CRLF, `#` lines
/// are comments, fields may be quoted. Rows are counted from 0, messages name the line in the file.
class CsvTable {
 public:
  /// Refuses a text without header, a column without a name or named twice, a row of another length than the header, an
  /// open quote, bytes that are not UTF-8.
  [[nodiscard]] static Result<CsvTable> parse(std::string_view text, std::string where);
  /// What another reader took apart, for the same checks and the same messages. Refuses as parse() does.
  struct Row {
    int line = 0;
    std::vector<std::string> fields;
  };
  [[nodiscard]] static Result<CsvTable> from_rows(std::string where, const Row& header, const std::vector<Row>& rows);

  [[nodiscard]] const std::string& where() const { return where_; }
  [[nodiscard]] const std::vector<std::string>& columns() const { return columns_; }
  [[nodiscard]] std::size_t size() const { return rows_.size(); }
  [[nodiscard]] int line(std::size_t row) const { return rows_[row].line; }

  [[nodiscard]] std::optional<std::size_t> find(std::string_view column) const;
  /// Refuses a column that is not there, naming those that are.
  [[nodiscard]] Result<std::size_t> require(std::string_view column) const;
  /// All of them, none of them (empty result), or refused.
  [[nodiscard]] Result<std::vector<std::size_t>> all_or_none(const std::vector<std::string>& columns) const;

  [[nodiscard]] const std::string& field(std::size_t row, std::size_t column) const {
    return rows_[row].fields[column];
  }
  /// Refuses what is not a finite number of magnitude <= `limit`.
  [[nodiscard]] Result<double> number(std::size_t row, std::size_t column, double limit = 1e12) const;
  [[nodiscard]] Result<int> integer(std::size_t row, std::size_t column, int lowest, int highest) const;
  /// A unit quaternion from four columns w, x, y, z, as a rotation matrix; limit of its length's error 1e-3.
  [[nodiscard]] Result<Eigen::Matrix3d> rotation(std::size_t row, const std::vector<std::size_t>& wxyz) const;
  /// With the file and the line of the row.
  template <typename... Args>
  [[nodiscard]] Failure refuse(std::size_t row, fmt::format_string<Args...> text, Args&&... args) const {
    return refused(text, std::forward<Args>(args)...).in(where_).at_row(line(row));
  }

 private:
  [[nodiscard]] Status set_columns(Row header);
  [[nodiscard]] Status add_row(Row row);

  std::string where_;
  std::vector<std::string> columns_;
  std::vector<Row> rows_;
};

/// The field as CsvTable reads it back: quoted where it must be.
[[nodiscard]] std::string csv_field(std::string_view text);
/// The shortest decimal form that keeps 12 digits.
[[nodiscard]] std::string csv_number(double value);

}  // namespace trammel
