#include "server/measurement/files/csv_dialect.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <vector>

#include "server/base/letters.h"
#include "server/base/plain_text.h"

namespace trammel {

namespace {

using namespace std::string_view_literals;

constexpr std::array kSeparators = {',', ';', '\t'};
constexpr const char* kExport =
    "export it as text: Save As, \"CSV UTF-8\", in Excel; \"Text CSV\" in LibreOffice";

std::string_view without_mark(std::string_view text) {
  return text.starts_with("\xEF\xBB\xBF") ? text.substr(3) : text;
}

/// The first record of the text that is neither empty nor a comment, and the text behind it.
struct Record {
  std::string_view text, rest;
};

Record first_record(std::string_view text) {
  while (!text.empty()) {
    const std::size_t start = text.find_first_not_of(" \t\r\n");
    if (start == std::string_view::npos) return {};
    text.remove_prefix(start);
    if (text.front() != '#') break;
    text.remove_prefix(std::min(text.find('\n'), text.size()));
  }
  bool quoted = false;
  for (std::size_t k = 0; k < text.size(); ++k) {
    if (text[k] == '"') quoted = !quoted;
    if (text[k] == '\n' && !quoted) return {text.substr(0, k), text.substr(k)};
  }
  return {text, {}};
}

/// True if the tab at `at` only pads another separator.
bool is_padding(std::string_view record, std::size_t at) {
  const auto before = at == 0 ? std::string_view::npos : record.find_last_not_of(" \t", at - 1);
  const auto after = record.find_first_not_of(" \t\r", at);
  const auto separates = [&](std::size_t k) { return record[k] == ',' || record[k] == ';'; };
  return (before != std::string_view::npos && separates(before)) ||
         (after != std::string_view::npos && separates(after));
}

std::size_t count_of(char separator, std::string_view record) {
  std::size_t count = 0;
  bool quoted = false;
  for (std::size_t k = 0; k < record.size(); ++k) {
    if (record[k] == '"') quoted = !quoted;
    if (quoted || record[k] != separator) continue;
    count += separator == '\t' && is_padding(record, k) ? 0 : 1;
  }
  return count;
}

std::string spelled(char separator) {
  return separator == '\t' ? "a tab" : fmt::format("'{}'", separator);
}

/// Parses a first line `sep=;`; empty if the text does not begin with one.
std::optional<CsvStart> said(std::string_view text) {
  if (text.size() < 5 || lower(text[0]) != 's' || lower(text[1]) != 'e' || lower(text[2]) != 'p' ||
      text[3] != '=')
    return std::nullopt;
  const bool known =
      std::find(kSeparators.begin(), kSeparators.end(), text[4]) != kSeparators.end();
  const std::size_t end = text.find('\n');
  const bool alone =
      text.substr(5, end == std::string_view::npos ? end : end - 5).find_first_not_of(" \r") ==
      std::string_view::npos;
  if (!known || !alone || end == std::string_view::npos) return std::nullopt;
  return CsvStart{text[4], end + 1, 2};
}

}  // namespace

Status check_is_text(std::string_view text, const std::string& where) {
  if (text.starts_with("PK\x03\x04"sv))
    return refused("not text but a spreadsheet (.xlsx, .ods) or an archive")
        .in(where)
        .next(kExport);
  if (text.starts_with("\xD0\xCF\x11\xE0"sv))
    return refused("not text but a spreadsheet (.xls)").in(where).next(kExport);
  if (text.starts_with("\xFF\xFE"sv) || text.starts_with("\xFE\xFF"sv))
    return refused("text in UTF-16, expected UTF-8").in(where).next(kExport);
  if (text.find('\r') != std::string_view::npos && text.find('\n') == std::string_view::npos)
    return refused("lines end with CR alone, as old programs write them")
        .in(where)
        .next("save it with line ends of Windows (CRLF) or Unix (LF)");
  if (text.starts_with("%PDF"sv) || text.starts_with("\x1F\x8B"sv))
    return refused("not text but a {}", text.front() == '%' ? "PDF" : "compressed file")
        .in(where)
        .next("name the table itself, as CSV");
  if (const std::string_view seen = without_mark(text); seen.starts_with("<"sv))
    return refused("not text but {}", seen.starts_with("<?xml"sv) ? "XML" : "a web page")
        .in(where)
        .next("name the table itself, as CSV");
  return {};
}

Result<CsvStart> start_of_csv(std::string_view text, const std::string& where) {
  CsvStart start;
  start.skipped_bytes = text.size() - without_mark(text).size();
  text = without_mark(text);
  if (const auto directive = said(text)) {
    start.separator = directive->separator;
    start.skipped_bytes += directive->skipped_bytes;
    start.line = directive->line;
    return start;
  }
  const Record header = first_record(text), row = first_record(header.rest);
  std::vector<char> found;
  for (const char separator : kSeparators) {
    if (count_of(separator, header.text) > 0) found.push_back(separator);
  }
  if (found.size() > 1) {
    std::vector<char> even;
    for (const char separator : found) {
      if (count_of(separator, header.text) == count_of(separator, row.text))
        even.push_back(separator);
    }
    if (even.size() != 1 && is_utf8(header.text)) {
      const auto line = std::count(text.data(), header.text.data(), '\n') + 1;
      return refused("{} and {} both stand between the names of columns", spelled(found[0]),
                     spelled(found[1]))
          .in(where)
          .at_row(line)
          .next(
              "put names that hold one of them in double quotes, or say by a first line sep=; "
              "which one separates");
    }
    if (even.size() == 1) found = even;
  }
  if (!found.empty()) start.separator = found.front();
  return start;
}

bool holds_quantities(std::string_view column) {
  constexpr std::array kUnits = {"_mm"sv, "_m"sv, "_in"sv, "_deg"sv, "_rad"sv,
                                 "_s"sv,  "_c"sv, "_n"sv,  "_kg"sv};
  constexpr std::array kBare = {"qw"sv,     "qx"sv,    "qy"sv,    "qz"sv, "x"sv,  "y"sv,  "z"sv,
                                "r"sv,      "theta"sv, "phi"sv,   "ux"sv, "uy"sv, "uz"sv, "ur"sv,
                                "utheta"sv, "uphi"sv,  "sigma"sv, "rx"sv, "ry"sv, "rz"sv, "a"sv,
                                "b"sv,      "c"sv,     "w"sv,     "p"sv};
  std::string name;
  for (const char c : column) name += lower(c);
  if (name.find_first_of("([{") != std::string::npos) return true;  // a unit in brackets
  const auto ends_so = [&](std::string_view unit) { return name.ends_with(unit); };
  if (std::any_of(kUnits.begin(), kUnits.end(), ends_so)) return true;
  if (std::find(kBare.begin(), kBare.end(), name) != kBare.end()) return true;
  const auto digits = name.find_first_of("0123456789");
  const std::string_view stem = std::string_view(name).substr(0, digits);
  const bool numbered =
      digits != std::string::npos &&
      std::all_of(name.begin() + static_cast<std::ptrdiff_t>(digits), name.end(), is_digit);
  return numbered &&
         (stem == "j" || stem == "q" || stem == "a" || stem == "joint" || stem == "joint ");
}

std::optional<char> decimal_sign(std::string_view field) {
  if (field.starts_with('+') || field.starts_with('-')) field.remove_prefix(1);
  const std::size_t whole = std::min(field.find_first_not_of("0123456789"), field.size());
  if (whole == field.size() || (field[whole] != '.' && field[whole] != ',')) return std::nullopt;
  const char sign = field[whole];
  const std::string_view behind = field.substr(whole + 1);
  const std::size_t decimals = std::min(behind.find_first_not_of("0123456789"), behind.size());
  if (whole + decimals == 0) return std::nullopt;
  std::string_view rest = behind.substr(decimals);
  if (rest.empty()) return sign;
  if (lower(rest.front()) != 'e') return std::nullopt;
  rest.remove_prefix(1);
  if (rest.starts_with('+') || rest.starts_with('-')) rest.remove_prefix(1);
  return !rest.empty() && std::all_of(rest.begin(), rest.end(), is_digit) ? std::optional(sign)
                                                                          : std::nullopt;
}

std::string with_decimal_point(std::string_view field) {
  std::string text(field);
  if (decimal_sign(field) == ',') text[text.find(',')] = '.';
  return text;
}

}  // namespace trammel
