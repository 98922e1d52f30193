#include "server/measurement/files/text_lines.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <optional>

#include "server/base/letters.h"
#include "server/measurement/files/csv_dialect.h"

namespace trammel {

namespace {

constexpr std::string_view kBlanks = " \t\r";
constexpr std::size_t kMostLines = 1'000'000;
constexpr std::size_t kMostDataLines = 100'000;

/// The end of the field at the start of `line`.
std::size_t field_end(std::string_view line, char separator) {
  const std::string_view ends =
      separator == ' ' ? std::string_view(" \t") : std::string_view(&separator, 1);
  const auto start = line.find_first_not_of(kBlanks);
  const bool quoted = start != std::string_view::npos && line[start] == '"';
  const auto closing = quoted ? line.find('"', start + 1) : std::string_view::npos;
  return std::min(line.find_first_of(ends, closing == std::string_view::npos ? 0 : closing),
                  line.size());
}

std::string_view unquoted(std::string_view field) {
  const bool quoted = field.size() >= 2 && field.front() == '"' && field.back() == '"';
  return quoted ? trimmed(field.substr(1, field.size() - 2)) : field;
}

/// Reads a text line by line.
class LineReader {
 public:
  explicit LineReader(std::string_view text) : text_(text) {
    if (text_.starts_with("\xEF\xBB\xBF")) text_.remove_prefix(3);
  }

  /// The next line that is not empty.
  std::optional<TextLine> next() {
    while (!text_.empty()) {
      ++number_;
      const std::size_t end = std::min(text_.find('\n'), text_.size());
      const std::string_view line = trimmed(text_.substr(0, end));
      text_.remove_prefix(std::min(end + 1, text_.size()));
      if (line.empty()) continue;
      const std::size_t mark = line.starts_with("//") ? 2 : line.starts_with('#') ? 1 : 0;
      return TextLine{number_, trimmed(line.substr(mark)), mark > 0};
    }
    return std::nullopt;
  }

 private:
  std::string_view text_;
  int number_ = 0;
};

/// `3233,9547` or `3233.9547`; not `5,`, which ends a value.
bool is_number_with_decimals(const std::string& field) {
  const std::size_t comma = field.find(',');
  const bool within =
      comma == std::string::npos || (comma > 0 && is_digit(field[comma - 1]) &&
                                     comma + 1 < field.size() && is_digit(field[comma + 1]));
  return within && is_number(with_decimal_point(field));
}

/// True if blanks separate the values of a line that also has commas or tabs. Then each comma is a
/// decimal comma (`p1 3233,95 -2853,67 1899,04`), or two lists of numbers stand side by side with a
/// tab between them.
bool do_blanks_separate(std::string_view line) {
  const bool tabs = line.find('\t') != std::string_view::npos;
  const std::vector<std::string> fields = split_fields(line, ' ');
  const auto has_comma = [](const std::string& field) {
    return field.find(',') != std::string::npos;
  };
  const bool named = !tabs && !has_comma(fields.front());
  const bool numbers =
      std::all_of(fields.begin() + (named ? 1 : 0), fields.end(), is_number_with_decimals);
  if (!numbers || fields.size() < 2) return false;
  return tabs ? split_fields(line, '\t').size() < fields.size()
              : std::any_of(fields.begin(), fields.end(), has_comma);
}

}  // namespace

Result<std::vector<TextLine>> text_lines(std::string_view text, const std::string& where,
                                         std::size_t longest) {
  TRY(check_is_text(text, where));
  std::vector<TextLine> lines;
  std::size_t data = 0;
  for (LineReader reader(text); const auto line = reader.next();) {
    if (line->text.size() > longest)
      return failure(ErrorCode::kTooLarge, "a line of {} bytes, limit {}", line->text.size(),
                     longest)
          .in(where)
          .at_row(line->number)
          .beyond(line->text.size(), longest);
    data += line->comment ? 0 : 1;
    if (lines.size() == kMostLines || data > kMostDataLines)
      return failure(ErrorCode::kTooLarge, "more than {} lines, of data {}", kMostLines,
                     kMostDataLines)
          .in(where)
          .beyond(lines.size() + 1, data > kMostDataLines ? kMostDataLines : kMostLines);
    lines.push_back(*line);
  }
  return lines;
}

std::vector<TextLine> first_lines(std::string_view text, std::size_t count) {
  std::vector<TextLine> lines;
  for (LineReader reader(text); lines.size() < count;) {
    const auto line = reader.next();
    if (!line) break;
    if (!line->comment) lines.push_back(*line);
  }
  return lines;
}

char separator_of(std::string_view line) {
  if (line.find(';') == std::string_view::npos && do_blanks_separate(line)) return ' ';
  for (const char separator : {';', '\t', ','}) {
    if (line.find(separator) != std::string_view::npos) return separator;
  }
  return ' ';
}

std::vector<std::string> split_fields(std::string_view line, char separator) {
  std::vector<std::string> fields;
  while (true) {
    if (separator == ' ') line = trimmed(line);
    const std::size_t end = field_end(line, separator);
    fields.emplace_back(unquoted(trimmed(line.substr(0, end))));
    if (end == line.size()) return fields;
    line.remove_prefix(end + 1);
  }
}

Result<std::vector<CsvTable::Row>> data_rows(const std::vector<TextLine>& lines, char separator,
                                             const std::string& where) {
  std::vector<CsvTable::Row> rows;
  std::size_t values = 0;
  for (const TextLine& line : lines) {
    if (line.comment) continue;
    rows.push_back({line.number, split_fields(line.text, separator)});
    values += rows.back().fields.size();
    if (values > CsvTable::kMostValues)
      return failure(ErrorCode::kTooLarge, "more than {} values", CsvTable::kMostValues)
          .in(where)
          .at_row(line.number)
          .beyond(values, CsvTable::kMostValues);
  }
  return rows;
}

bool is_number(std::string_view field) {
  if (field.starts_with('+')) field.remove_prefix(1);
  double value = 0;
  const auto [end, error] = std::from_chars(field.data(), field.data() + field.size(), value);
  return error == std::errc() && end == field.data() + field.size() && !field.empty();
}

std::optional<int> joint_number(std::string_view name) {
  constexpr int kMostJoints = 12;
  for (const std::string_view prefix :
       {"joint", "axis", "achse", "axe", "asse", "eje", "gelenk", "theta", "j", "a", "q"}) {
    if (!name.starts_with(prefix)) continue;
    const std::string_view digits = name.substr(prefix.size());
    int number = 0;
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), number);
    const bool whole = error == std::errc() && end == digits.data() + digits.size();
    if (whole && number >= 0 && number <= kMostJoints) return number;
  }
  return std::nullopt;
}

ColumnName column_name(std::string_view field) {
  ColumnName column;
  const auto bracket = std::min(field.find_first_of("([{"), field.size());
  for (const char c : field.substr(bracket)) {
    if (std::isalpha(static_cast<unsigned char>(c)) != 0) column.unit += lower(c);
  }
  for (const std::string_view unit : {"deg", "rad", "in"}) {
    if (column.unit.starts_with(unit)) column.unit = unit;
  }
  // German, Italian and Spanish degrees. Gon, which English calls so, do not follow the joints.
  if (column.unit.starts_with("grad")) column.unit = "deg";
  std::string_view name = trimmed(field.substr(0, bracket));
  if (const auto underscore = name.rfind('_');
      column.unit.empty() && underscore != std::string_view::npos) {
    std::string last;
    for (const char c : name.substr(underscore + 1)) last += lower(c);
    for (const std::string_view unit : {"mm", "m", "in", "deg", "rad", "s"}) {
      if (last == unit) column.unit = unit;
    }
    if (!column.unit.empty()) name = name.substr(0, underscore);
  }
  for (const char c : name) {
    if (std::isalnum(static_cast<unsigned char>(c)) != 0) column.name += lower(c);
  }
  return column;
}

}  // namespace trammel
