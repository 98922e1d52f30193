#include "server/measurement/files/text_lines.h"

#include <algorithm>
#include <cctype>
#include <charconv>

namespace trammel {

namespace {

constexpr std::string_view kBlanks = " \t\r";

std::string_view trimmed(std::string_view text) {
  const auto first = text.find_first_not_of(kBlanks);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(kBlanks) - first + 1);
}

char lower(char c) { return static_cast<char>(std::tolower(static_cast<unsigned char>(c))); }

/// Where the field at the start of `line` ends.
std::size_t field_end(std::string_view line, char separator) {
  const std::string_view ends = separator == ' ' ? std::string_view(" \t") : std::string_view(&separator, 1);
  const auto start = line.find_first_not_of(kBlanks);
  const bool quoted = start != std::string_view::npos && line[start] == '"';
  const auto closing = quoted ? line.find('"', start + 1) : std::string_view::npos;
  return std::min(line.find_first_of(ends, closing == std::string_view::npos ? 0 : closing), line.size());
}

std::string_view unquoted(std::string_view field) {
  const bool quoted = field.size() >= 2 && field.front() == '"' && field.back() == '"';
  return quoted ? trimmed(field.substr(1, field.size() - 2)) : field;
}

}  // namespace

std::vector<TextLine> text_lines(std::string_view text) {
  if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
  std::vector<TextLine> lines;
  for (int number = 1; !text.empty(); ++number) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    const std::string_view line = trimmed(text.substr(0, end));
    text.remove_prefix(std::min(end + 1, text.size()));
    if (line.empty()) continue;
    const std::size_t mark = line.starts_with("//") ? 2 : line.starts_with('#') ? 1 : 0;
    lines.push_back({number, trimmed(line.substr(mark)), mark > 0});
  }
  return lines;
}

char separator_of(std::string_view line) {
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

bool is_number(std::string_view field) {
  if (field.starts_with('+')) field.remove_prefix(1);
  double value = 0;
  const auto [end, error] = std::from_chars(field.data(), field.data() + field.size(), value);
  return error == std::errc() && end == field.data() + field.size() && !field.empty();
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
  std::string_view name = trimmed(field.substr(0, bracket));
  if (const auto underscore = name.rfind('_'); column.unit.empty() && underscore != std::string_view::npos) {
    for (const std::string_view unit : {"mm", "m", "in", "deg", "rad", "s"}) {
      if (name.substr(underscore + 1) == unit) column.unit = unit;
    }
    if (!column.unit.empty()) name = name.substr(0, underscore);
  }
  for (const char c : name) {
    if (std::isalnum(static_cast<unsigned char>(c)) != 0) column.name += lower(c);
  }
  return column;
}

}  // namespace trammel
