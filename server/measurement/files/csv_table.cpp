#include "server/measurement/files/csv_table.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <set>

#include "server/base/plain_text.h"

namespace trammel {

namespace {

constexpr double kQuaternionLimit = 1e-3;

std::string_view trimmed(std::string_view text) {
  const auto first = text.find_first_not_of(" \t\r");
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(" \t\r") - first + 1);
}

constexpr std::size_t kMostValueBytes = 65'536;  // of one value

/// Whether the values of a row may stand in a table.
Status check_values(const CsvTable::Row& row, const std::string& where) {
  if (row.fields.size() > CsvTable::kMostColumns)
    return failure(ErrorCode::kTooLarge, "more than {} values in one row", CsvTable::kMostColumns)
        .in(where)
        .at_row(row.line)
        .beyond(row.fields.size(), CsvTable::kMostColumns);
  for (const std::string& field : row.fields) {
    if (field.size() > kMostValueBytes)
      return failure(ErrorCode::kTooLarge, "a value of {} bytes, limit {}", field.size(), kMostValueBytes)
          .in(where)
          .at_row(row.line)
          .beyond(field.size(), kMostValueBytes);
    if (!is_utf8(field)) return refused("not UTF-8 text").in(where).at_row(row.line);
    if (!is_plain_lines(field))
      return refused("'{}' has control characters", shown_short(field)).in(where).at_row(row.line);
  }
  return {};
}

/// Reads the text record by record.
class Scanner {
 public:
  Scanner(std::string_view text, const std::string& where) : text_(text), where_(where) {
    if (text_.starts_with("\xEF\xBB\xBF")) text_.remove_prefix(3);
  }

  /// The next record that is neither empty nor a comment; no fields at the end of the text.
  Result<CsvTable::Row> next() {
    skip_comments();
    CsvTable::Row record;
    record.line = line_;
    while (!text_.empty()) {
      Result<std::string> field = trimmed_start() == '"' ? quoted() : plain();
      if (!field) return tl::make_unexpected(field.error());
      record.fields.push_back(std::move(*field));
      if (record.fields.size() > CsvTable::kMostColumns) break;
      if (text_.empty()) break;
      const char separator = text_.front();
      text_.remove_prefix(1);
      if (separator == '\n') {
        ++line_;
        break;
      }
      if (text_.empty()) record.fields.emplace_back();  // the file ends with a separator
    }
    if (const Status fine = check_values(record, where_); !fine) return tl::make_unexpected(fine.error());
    return record;
  }

 private:
  void skip_comments() {
    while (!text_.empty()) {
      const std::size_t end = std::min(text_.find('\n'), text_.size());
      const std::string_view line = trimmed(text_.substr(0, end));
      if (!line.empty() && line.front() != '#') return;
      text_.remove_prefix(std::min(end + 1, text_.size()));
      ++line_;
    }
  }

  [[nodiscard]] char trimmed_start() const {
    const auto at = text_.find_first_not_of(" \t");
    return at == std::string_view::npos ? '\n' : text_[at];
  }

  Result<std::string> plain() {
    const std::size_t end = std::min(text_.find_first_of(",\n"), text_.size());
    std::string field(trimmed(text_.substr(0, end)));
    text_.remove_prefix(end);
    return field;
  }

  Result<std::string> quoted() {
    const int first_line = line_;
    text_.remove_prefix(text_.find('"') + 1);
    std::string field;
    while (!text_.empty()) {
      const char c = text_.front();
      text_.remove_prefix(1);
      if (c == '"' && !text_.starts_with('"')) return rest_after_quote(first_line, std::move(field));
      if (c == '"') text_.remove_prefix(1);
      if (c == '\n') ++line_;
      field += c;
    }
    return refused("a quote is not closed").in(where_).at_row(first_line);
  }

  Result<std::string> rest_after_quote(int first_line, std::string field) {
    const std::size_t end = std::min(text_.find_first_of(",\n"), text_.size());
    if (const std::string_view rest = trimmed(text_.substr(0, end)); !rest.empty()) {
      return refused("'{}' after a closing quote, expected ','", shown_short(rest)).in(where_).at_row(first_line);
    }
    text_.remove_prefix(end);
    return field;
  }

  std::string_view text_;
  const std::string& where_;
  int line_ = 1;
};

}  // namespace

Status CsvTable::set_columns(Row header) {
  std::set<std::string> seen;
  for (const std::string& name : header.fields) {
    if (name.empty())
      return refused("column {} has no name", seen.size() + 1)
          .in(where_)
          .at_row(header.line)
          .with_value(seen.size() + 1);
    if (const Status plain = check_name(name, "column name"); !plain)
      return Failure(plain.error()).in(where_).at_row(header.line);
    if (!seen.insert(name).second) {
      return refused("column {} appears twice", shown_short(name)).in(where_).at_row(header.line).of(shown_short(name));
    }
  }
  columns_ = std::move(header.fields);
  return {};
}

Status CsvTable::add_row(Row row) {
  if (row.fields.size() != columns_.size()) {
    return refused("{} values, the header has {} columns", row.fields.size(), columns_.size())
        .in(where_)
        .beyond(row.fields.size(), columns_.size())
        .at_row(row.line);
  }
  if (rows_.size() == most_rows_)
    return failure(ErrorCode::kTooLarge, "more than {} rows", most_rows_)
        .in(where_)
        .at_row(row.line)
        .beyond(rows_.size() + 1, most_rows_);
  if ((rows_.size() + 1) * columns_.size() > kMostValues)
    return failure(ErrorCode::kTooLarge, "more than {} values", kMostValues)
        .in(where_)
        .at_row(row.line)
        .beyond((rows_.size() + 1) * columns_.size(), kMostValues);
  rows_.push_back(std::move(row));
  return {};
}

Result<CsvTable> CsvTable::parse(std::string_view text, std::string where, std::size_t most_rows) {
  CsvTable table;
  table.where_ = std::move(where);
  table.most_rows_ = most_rows;
  Scanner scanner(text, table.where_);
  Result<Row> header = scanner.next();
  if (!header) return tl::make_unexpected(header.error());
  if (header->fields.empty())
    return refused("empty file, expected a header line with column names").in(table.where_).beyond(0, 1);
  if (const Status set = table.set_columns(std::move(*header)); !set) return tl::make_unexpected(set.error());
  while (true) {
    Result<Row> record = scanner.next();
    if (!record) return tl::make_unexpected(record.error());
    if (record->fields.empty()) return table;
    if (const Status added = table.add_row(std::move(*record)); !added) return tl::make_unexpected(added.error());
  }
}

Result<CsvTable> CsvTable::from_rows(std::string where, const Row& header, const std::vector<Row>& rows) {
  CsvTable table;
  table.where_ = std::move(where);
  if (const Status set = table.set_columns(header); !set) return tl::make_unexpected(set.error());
  for (const Row& row : rows) {
    if (const Status fine = check_values(row, table.where_); !fine) return tl::make_unexpected(fine.error());
    if (const Status added = table.add_row(row); !added) return tl::make_unexpected(added.error());
  }
  return table;
}

std::optional<std::size_t> CsvTable::find(std::string_view column) const {
  const auto at = std::find(columns_.begin(), columns_.end(), column);
  if (at == columns_.end()) return std::nullopt;
  return static_cast<std::size_t>(at - columns_.begin());
}

Result<std::size_t> CsvTable::require(std::string_view column) const {
  if (const auto at = find(column)) return *at;
  const std::string names = shown_short(fmt::format("{}", fmt::join(columns_, ",")));
  const bool semicolons = columns_.size() == 1 && columns_[0].find(';') != std::string::npos;
  return refused("missing column {}", column)
      .in(where_)
      .of(std::string(column))
      .next(fmt::format("the header has: {}{}", names, semicolons ? " (columns must be separated by ',')" : ""));
}

Result<std::vector<std::size_t>> CsvTable::all_or_none(const std::vector<std::string>& columns) const {
  std::vector<std::size_t> found;
  std::vector<std::string> missing;
  for (const std::string& column : columns) {
    if (const auto at = find(column)) {
      found.push_back(*at);
    } else {
      missing.push_back(column);
    }
  }
  if (found.empty() || missing.empty()) return found;
  return refused("missing column {}", missing.front())
      .in(where_)
      .of(missing.front())
      .next(fmt::format("{} come all together or not at all", fmt::join(columns, ", ")));
}

Result<std::string> CsvTable::name(std::size_t row, std::size_t column) const {
  const std::string& text = field(row, column);
  if (const Status plain = check_name(text, columns_[column].c_str()); !plain)
    return Failure(plain.error()).in(where_).at_row(line(row));
  return text;
}

Result<double> CsvTable::number(std::size_t row, std::size_t column, double limit) const {
  std::string_view text = field(row, column);
  if (text.empty()) return refuse(row, "{} is empty, expected a number", columns_[column]).of(columns_[column]);
  if (text.starts_with('+')) text.remove_prefix(1);
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error == std::errc::result_out_of_range) {
    return refuse(row, "{} is {}, limit {:g}", columns_[column], shown_short(field(row, column)), limit)
        .of(columns_[column])
        .with_text(shown_short(field(row, column)))
        .beyond(std::copysign(std::numeric_limits<double>::infinity(), text.starts_with('-') ? -1 : 1), limit);
  }
  if (error != std::errc() || end != text.data() + text.size()) {
    return refuse(row, "{} is '{}', expected a number", columns_[column], shown_short(field(row, column)))
        .of(columns_[column])
        .with_text(shown_short(field(row, column)));
  }
  if (!std::isfinite(value)) {
    return refuse(row, "{} is {}, expected a finite number", columns_[column], field(row, column))
        .of(columns_[column])
        .with_text(field(row, column));
  }
  if (std::abs(value) > limit) {
    return refuse(row, "{} is {:g}, limit {:g}", columns_[column], value, limit)
        .of(columns_[column])
        .beyond(value, limit);
  }
  return value;
}

Result<int> CsvTable::integer(std::size_t row, std::size_t column, int lowest, int highest) const {
  const Result<double> value = number(row, column);
  if (!value) return tl::make_unexpected(value.error());
  if (*value != std::floor(*value) || *value < lowest || *value > highest) {
    return refuse(row, "{} is {}, expected a whole number from {} to {}", columns_[column],
                  shown_short(field(row, column)), lowest, highest)
        .of(columns_[column])
        .beyond(*value, *value < lowest ? lowest : highest);
  }
  return static_cast<int>(*value);
}

Result<Eigen::Matrix3d> CsvTable::rotation(std::size_t row, const std::vector<std::size_t>& wxyz) const {
  Eigen::Vector4d values;
  for (std::size_t k = 0; k < 4; ++k) {
    const Result<double> value = number(row, wxyz[k]);
    if (!value) return tl::make_unexpected(value.error());
    values(static_cast<Eigen::Index>(k)) = *value;
  }
  if (std::abs(values.norm() - 1) > kQuaternionLimit) {
    return refuse(row, "quaternion {},{},{},{} has length {:.6g}, expected 1 (limit {:g})", columns_[wxyz[0]],
                  columns_[wxyz[1]], columns_[wxyz[2]], columns_[wxyz[3]], values.norm(), kQuaternionLimit)
        .of(columns_[wxyz[0]])
        .beyond(values.norm(), 1);
  }
  values.normalize();
  return Eigen::Quaterniond(values(0), values(1), values(2), values(3)).toRotationMatrix();
}

std::string csv_field(std::string_view text) {
  const bool bare =
      text.find_first_of(",\"\n\r") == std::string_view::npos && trimmed(text) == text && !text.starts_with('#');
  if (bare) return std::string(text);
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"') quoted += '"';
    quoted += c;
  }
  return quoted + '"';
}

std::string csv_number(double value) { return fmt::format("{:.12g}", value); }

}  // namespace trammel
