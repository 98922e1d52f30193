#include "server/measurement/files/csv_table.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <set>

#include "server/base/letters.h"
#include "server/base/name_check.h"
#include "server/base/near_miss.h"
#include "server/base/plain_text.h"
#include "server/measurement/files/csv_dialect.h"

namespace trammel {

namespace {

constexpr double kQuaternionLimit = 1e-3;

constexpr std::size_t kMostValueBytes = 65'536;  // of one value
constexpr const char* kSaveAsUtf8 = "save it as UTF-8: \"CSV UTF-8\" in Excel";
constexpr const char* kTwoCommas =
    "write decimal points, or separate values by ';' or tabs: a comma that does both may be read "
    "in two ways";
constexpr const char* kThousands =
    "leave out what separates thousands: 1234.5 instead of 1,234.5 or 1.234,5";

/// The advice that turns a value into a number. Blanks of all kinds and apostrophes separate
/// thousands; word processors write another minus.
const char* mended(std::string text) {
  for (const std::string_view minus : {"\u2212", "\u2013"})
    if (text.starts_with(minus)) return "its minus is another character: write it as '-'";
  for (const std::string_view apart : {" ", "\u00a0", "\u202f", "\u2009", "'"}) {
    for (auto at = text.find(apart); at != std::string::npos; at = text.find(apart)) {
      text.erase(at, apart.size());
      if (decimal_sign(text)) return kThousands;
    }
  }
  const bool comma = text.find(',') != std::string::npos;
  if (comma && text.find('.') != std::string::npos) return kThousands;
  return comma ? kTwoCommas : "write it with digits alone: the unit stands in the column's name";
}

/// Checks that the values of a row may stand in a table.
Status check_values(const CsvTable::Row& row, const std::string& where) {
  if (row.fields.size() > CsvTable::kMostColumns)
    return failure(ErrorCode::kTooLarge, "more than {} values in one row", CsvTable::kMostColumns)
        .in(where)
        .at_row(row.line)
        .beyond(row.fields.size(), CsvTable::kMostColumns);
  for (const std::string& field : row.fields) {
    if (field.size() > kMostValueBytes)
      return failure(ErrorCode::kTooLarge, "a value of {} bytes, limit {}", field.size(),
                     kMostValueBytes)
          .in(where)
          .at_row(row.line)
          .beyond(field.size(), kMostValueBytes);
    if (!is_utf8(field))
      return refused("not UTF-8 text").in(where).at_row(row.line).next(kSaveAsUtf8);
    if (!is_plain_lines(field))
      return refused("'{}' has control characters", shown_short(field)).in(where).at_row(row.line);
  }
  return {};
}

/// Reads the text record by record.
class Scanner {
 public:
  Scanner(std::string_view text, const CsvStart& start, const std::string& where)
      : text_(text.substr(start.skipped_bytes)),
        where_(where),
        separator_(start.separator),
        ends_{start.separator, '\n'},
        line_(start.line) {}

  /// The next record that is neither empty nor a comment; no fields at the end of the text.
  Result<CsvTable::Row> next() {
    skip_comments();
    CsvTable::Row record;
    record.line = line_;
    while (!text_.empty()) {
      std::string field = TRY(trimmed_start() == '"' ? quoted() : plain());
      record.fields.push_back(std::move(field));
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
    TRY(check_values(record, where_));
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
    const auto at = text_.find_first_not_of(separator_ == '\t' ? " " : " \t");
    return at == std::string_view::npos ? '\n' : text_[at];
  }

  Result<std::string> plain() {
    const std::size_t end = std::min(text_.find_first_of(ends_), text_.size());
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
      if (c == '"' && !text_.starts_with('"'))
        return rest_after_quote(first_line, std::move(field));
      if (c == '"') text_.remove_prefix(1);
      if (c == '\n') ++line_;
      field += c;
    }
    return refused("a quote is not closed")
        .in(where_)
        .at_row(first_line)
        .next("close it in the same value");
  }

  Result<std::string> rest_after_quote(int first_line, std::string field) {
    const std::size_t end = std::min(text_.find_first_of(ends_), text_.size());
    if (const std::string_view rest = trimmed(text_.substr(0, end)); !rest.empty()) {
      return refused("'{}' after a closing quote, expected '{}'", shown_short(rest),
                     shown_short({&separator_, 1}))
          .in(where_)
          .at_row(first_line)
          .next("a quote inside a value is written twice");
    }
    text_.remove_prefix(end);
    return field;
  }

  std::string_view text_;
  const std::string& where_;
  char separator_;
  std::string ends_;  // characters that end an unquoted value
  int line_;
};

bool says_nothing(const CsvTable::Row& row) {
  return row.fields.size() > 1 &&
         std::all_of(row.fields.begin(), row.fields.end(),
                     [](const std::string& field) { return field.empty(); });
}

/// True if most of the row's values are numbers with a point, as measured ones are.
bool is_numbers(const CsvTable::Row& row) {
  const auto numbers =
      std::count_if(row.fields.begin(), row.fields.end(), [](const std::string& field) {
        return field.find('.') != std::string::npos &&
               field.find_first_not_of("+-.0123456789eE ") == std::string::npos;
      });
  return 2 * static_cast<std::size_t>(numbers) > row.fields.size();
}

}  // namespace

Status CsvTable::set_columns(Row header) {
  if (is_numbers(header))
    return refused("numbers where the names of the columns are expected")
        .in(where_)
        .at_row(header.line)
        .next("put a line of names above them, without #; trammel help formats tells the names");
  std::set<std::string> seen;
  for (const std::string& name : header.fields) {
    if (name.empty())
      return refused("column {} has no name", seen.size() + 1)
          .in(where_)
          .at_row(header.line)
          .with_value(seen.size() + 1)
          .next("name it, or delete it where it is empty");
    if (const Status plain = check_name(name, "column name"); !plain)
      return Failure(plain.error())
          .in(where_)
          .at_row(header.line)
          .next(is_utf8(name) ? "rename it" : kSaveAsUtf8);
    if (!seen.insert(name).second) {
      return refused("column {} appears twice", shown_short(name))
          .in(where_)
          .at_row(header.line)
          .of(shown_short(name))
          .next("rename one of them");
    }
  }
  columns_ = std::move(header.fields);
  return {};
}

Status CsvTable::add_row(Row row) {
  if (row.fields.size() != columns_.size()) {
    const bool pointless =
        std::all_of(row.fields.begin(), row.fields.end(),
                    [](const std::string& field) { return field.find('.') == std::string::npos; });
    const bool commas = separator_ == ',' && row.fields.size() > columns_.size() && pointless;
    const std::string title =
        columns_.size() > 1
            ? ""
            : fmt::format(
                  "is '{}' no name of a column? Delete what stands above the line of names, "
                  "or begin each such line with #",
                  shown_short(columns_.front()));
    return refused("{} values, the header has {} columns", row.fields.size(), columns_.size())
        .in(where_)
        .beyond(row.fields.size(), columns_.size())
        .at_row(row.line)
        .next(!title.empty() ? title
              : commas       ? kTwoCommas
                             : "a value that is not known stays empty between its separators");
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
  TRY(check_is_text(text, table.where_));
  const CsvStart start = TRY(start_of_csv(text, table.where_));
  table.separator_ = start.separator;
  Scanner scanner(text, start, table.where_);
  Row header = TRY(scanner.next());
  if (header.fields.empty())
    return refused("empty file, expected a header line with column names")
        .in(table.where_)
        .beyond(0, 1)
        .next("trammel help formats says which columns");
  TRY(table.set_columns(std::move(header)));
  while (true) {
    Row record = TRY(scanner.next());
    if (record.fields.empty()) break;
    if (says_nothing(record)) continue;
    TRY(table.add_row(std::move(record)));
  }
  TRY(table.settle_decimals());
  return table;
}

Result<CsvTable> CsvTable::from_rows(std::string where, const Row& header,
                                     const std::vector<Row>& rows, char separator) {
  CsvTable table;
  table.where_ = std::move(where);
  table.separator_ = separator;
  TRY(table.set_columns(header));
  for (const Row& row : rows) {
    TRY(check_values(row, table.where_));
    if (says_nothing(row)) continue;
    TRY(table.add_row(row));
  }
  TRY(table.settle_decimals());
  return table;
}

Status CsvTable::settle_decimals() {
  struct Met {
    const std::string* field = nullptr;
    std::size_t row = 0, column = 0;
  };
  Met comma, point;
  for (std::size_t column = 0; column < columns_.size(); ++column) {
    if (!holds_quantities(columns_[column])) continue;
    for (std::size_t row = 0; row < rows_.size(); ++row) {
      const auto sign = decimal_sign(rows_[row].fields[column]);
      Met& met = sign == ',' ? comma : point;
      if (sign && met.field == nullptr) met = {&rows_[row].fields[column], row, column};
    }
  }
  points_ = point.field != nullptr;
  if (comma.field == nullptr) return {};
  if (separator_ == ',') {
    return refuse(comma.row, "{} is '{}', with a comma where values are separated by commas",
                  columns_[comma.column], shown_short(*comma.field))
        .of(columns_[comma.column])
        .with_text(shown_short(*comma.field))
        .next(kTwoCommas);
  }
  if (points_) {
    const Met& later = comma.row < point.row ? point : comma;
    const Met& earlier = comma.row < point.row ? comma : point;
    return refuse(later.row, "{} is '{}', and row {} has '{}': a point and a comma before decimals",
                  columns_[later.column], shown_short(*later.field), line(earlier.row),
                  shown_short(*earlier.field))
        .of(columns_[later.column])
        .with_text(shown_short(*later.field))
        .next("write all numbers of the file with the same one, and none for thousands");
  }
  for (std::size_t column = 0; column < columns_.size(); ++column) {
    if (!holds_quantities(columns_[column])) continue;
    for (Row& row : rows_) row.fields[column] = with_decimal_point(row.fields[column]);
  }
  return {};
}

std::optional<std::size_t> CsvTable::find(std::string_view column) const {
  const auto at = std::find(columns_.begin(), columns_.end(), column);
  if (at != columns_.end()) return static_cast<std::size_t>(at - columns_.begin());
  const auto alike = [wanted = lower(column)](const std::string& name) {
    return lower(name) == wanted;
  };
  const auto other = std::find_if(columns_.begin(), columns_.end(), alike);
  if (other == columns_.end() || std::find_if(other + 1, columns_.end(), alike) != columns_.end())
    return std::nullopt;
  return static_cast<std::size_t>(other - columns_.begin());
}

namespace {

/// Lists the columns that a missing name may have meant: a similar spelling, or the same name with
/// another unit. Empty if none is similar.
std::string meant_by(const std::string& column, const std::vector<std::string>& columns) {
  std::vector<std::string> names;
  for (const std::string& name : columns) names.push_back(lower(name));
  const auto spelled = [&](const std::string& name) -> const std::string& {
    return *std::find_if(columns.begin(), columns.end(),
                         [&](const std::string& one) { return lower(one) == name; });
  };
  const auto stem = [](const std::string& name) {
    return name.substr(0, name.find_first_of("_ (["));
  };
  std::vector<std::string> alike;
  for (const std::string& name : names) {
    if (stem(name) == stem(column) && column.find('_') != std::string::npos)
      alike.push_back(shown_short(spelled(name)));
  }
  if (!alike.empty()) return fmt::format("{}", fmt::join(alike, " or "));
  // `x_mm` and `y_mm`, `q1_deg` and `q2_deg` are near to each other and mean different things.
  constexpr std::size_t kTellsNothing = 2;
  std::erase_if(names, [&](const std::string& name) {
    return stem(name) != stem(column) &&
           (stem(name).size() <= kTellsNothing || stem(column).size() <= kTellsNothing);
  });
  const std::string near = near_miss(column, names);
  return near.empty() ? "" : shown_short(spelled(near));
}

}  // namespace

Result<std::size_t> CsvTable::require(std::string_view column) const {
  if (const auto at = find(column)) return *at;
  const std::string wanted(column);
  if (columns_.size() == 1 && columns_.front().find_first_of("| ") != std::string::npos)
    return refused("missing column {}", wanted)
        .in(where_)
        .of(wanted)
        .next(fmt::format("the only name is '{}': separate names and values by commas, semicolons "
                          "or tabs, and delete lines above the names",
                          shown_short(columns_.front())));
  const std::string meant = meant_by(wanted, columns_);
  const std::string names = shown_short(fmt::format("{}", fmt::join(columns_, ",")));
  return refused("missing column {}", wanted)
      .in(where_)
      .of(wanted)
      .next(meant.empty()
                ? fmt::format("the header has: {}; trammel help formats tells them all", names)
                : fmt::format("is it column {}? then call it {}, with its values in that unit",
                              meant, wanted));
}

Result<std::vector<std::size_t>> CsvTable::all_or_none(
    const std::vector<std::string>& columns) const {
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
  const std::string written =
      separator_ == ',' || points_ ? field(row, column) : with_decimal_point(field(row, column));
  std::string_view text = written;
  if (text.empty()) {
    return refuse(row, "{} is empty, expected a number", columns_[column])
        .of(columns_[column])
        .next("measure or fill it in, or delete the row");
  }
  if (text.starts_with('+')) text.remove_prefix(1);
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error == std::errc::result_out_of_range) {
    return refuse(row, "{} is {}, limit {:g}", columns_[column], shown_short(field(row, column)),
                  limit)
        .of(columns_[column])
        .with_text(shown_short(field(row, column)))
        .beyond(
            std::copysign(std::numeric_limits<double>::infinity(), text.starts_with('-') ? -1 : 1),
            limit);
  }
  if (error != std::errc() || end != text.data() + text.size()) {
    return refuse(row, "{} is '{}', expected a number", columns_[column],
                  shown_short(field(row, column)))
        .of(columns_[column])
        .with_text(shown_short(field(row, column)))
        .next(mended(std::string(text)));
  }
  if (!std::isfinite(value)) {
    return refuse(row, "{} is {}, expected a finite number", columns_[column], field(row, column))
        .of(columns_[column])
        .with_text(field(row, column));
  }
  if (std::abs(value) > limit) {
    return refuse(row, "{} is {:g}, limit {:g}", columns_[column], value, limit)
        .of(columns_[column])
        .beyond(value, limit)
        .next("are its values in another unit? The column's name says in which they are");
  }
  return value;
}

Result<int> CsvTable::integer(std::size_t row, std::size_t column, int lowest, int highest) const {
  const double value = TRY(number(row, column));
  if (value != std::floor(value) || value < lowest || value > highest) {
    return refuse(row, "{} is {}, expected a whole number from {} to {}", columns_[column],
                  shown_short(field(row, column)), lowest, highest)
        .of(columns_[column])
        .beyond(value, value < lowest ? lowest : highest);
  }
  return static_cast<int>(value);
}

Result<Eigen::Matrix3d> CsvTable::rotation(std::size_t row,
                                           const std::vector<std::size_t>& wxyz) const {
  Eigen::Vector4d values;
  for (std::size_t k = 0; k < 4; ++k) {
    const double value = TRY(number(row, wxyz[k]));
    values(static_cast<Eigen::Index>(k)) = value;
  }
  if (std::abs(values.norm() - 1) > kQuaternionLimit) {
    return refuse(row, "quaternion {},{},{},{} has length {:.6g}, expected 1 (limit {:g})",
                  columns_[wxyz[0]], columns_[wxyz[1]], columns_[wxyz[2]], columns_[wxyz[3]],
                  values.norm(), kQuaternionLimit)
        .of(columns_[wxyz[0]])
        .beyond(values.norm(), 1);
  }
  values.normalize();
  return Eigen::Quaterniond(values(0), values(1), values(2), values(3)).toRotationMatrix();
}

std::string csv_field(std::string_view text) {
  const bool bare = text.find_first_of(",;\t\"\n\r") == std::string_view::npos &&
                    trimmed(text) == text && !text.starts_with('#');
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
