#include "server/measurement/files/point_table.h"

#include <algorithm>
#include <cctype>
#include <map>
#include <regex>
#include <vector>

#include "server/base/letters.h"
#include "server/measurement/files/csv_dialect.h"
#include "server/measurement/files/text_lines.h"

namespace trammel {

namespace {

constexpr std::size_t kLeastFields = 4;
constexpr std::size_t kMostFields = 9;
constexpr std::size_t kLongestLineOfPoints =
    1000;                                   // bytes: regular expressions recurse once for each
constexpr std::size_t kMostComments = 500;  // each is searched for statements

template <typename T>
Status state(std::optional<T>& known, T said, const std::string& where, const char* what) {
  if (known && *known != said)
    return refused("two different statements of the {}", what).in(where).of(what);
  known = said;
  return {};
}

Result<LengthUnit> length_unit(const std::string& word, const std::string& where, int line) {
  if (word == "mm" || word.starts_with("millimet")) return LengthUnit::kMillimetre;
  if (word == "m" || word.starts_with("meter") || word.starts_with("metre"))
    return LengthUnit::kMetre;
  if (word == "in" || word.starts_with("inch")) return LengthUnit::kInch;
  return refused("unit is '{}', expected mm, m or inch", word)
      .in(where)
      .at_row(line)
      .of("unit")
      .with_text(word);
}

Result<bool> is_radian(const std::string& word, const std::string& where, int line) {
  if (word.starts_with("deg")) return false;
  if (word.starts_with("rad")) return true;
  return refused("angular unit is '{}', expected deg or rad", word)
      .in(where)
      .at_row(line)
      .of("angular unit")
      .with_text(word);
}

bool contains(const std::string& text, const std::regex& pattern) {
  return std::regex_search(text, pattern);
}

/// In lower case, with one blank between words: the time to search would grow with the square of a
/// run of blanks.
std::string words_of(std::string_view text) {
  std::string words;
  for (const char c : text) {
    const bool blank = std::isspace(static_cast<unsigned char>(c)) != 0;
    if (blank && (words.empty() || words.back() == ' ')) continue;
    words += blank ? ' ' : lower(c);
  }
  return words;
}

Status read_unit_statements(const std::string& comment, const std::string& where, int line,
                            Statements& statements) {
  static const std::regex kUnits(
      R"((angular|angle)?\s*\bunits?\s*(?:[:=]|\bare\b|\bin\b)\s*([a-z]+))");
  for (auto at = std::sregex_iterator(comment.begin(), comment.end(), kUnits);
       at != std::sregex_iterator(); ++at) {
    if ((*at)[1].matched) {
      const bool radians = TRY(is_radian((*at)[2], where, line));
      TRY(state(statements.radians, radians, where, "angular unit"));
    } else {
      const LengthUnit unit = TRY(length_unit((*at)[2], where, line));
      TRY(state(statements.unit, unit, where, "unit"));
    }
  }
  return {};
}

Status read_statements(const TextLine& line, const std::string& where, Statements& statements) {
  static const std::regex kCylindric("cylindric"), kSpherical("spherical|\\bpolar"),
      kCartesian("cartesian");
  static const std::regex kZyx(R"(\bzyx\s+euler|\beuler\s+(angles\s+)?\(?zyx)"),
      kEuler(R"(\beuler\b)");
  static const std::regex kFixed(R"(\bfixed\s+(xyz|angles)|\bxyz\s+fixed)"),
      kUncertain("\\buncertaint");
  const std::string comment = words_of(line.text);
  TRY(read_unit_statements(comment, where, line.number, statements));
  const auto coordinates = contains(comment, kCylindric) ? std::optional(Coordinates::kCylindrical)
                           : contains(comment, kSpherical) ? std::optional(Coordinates::kSpherical)
                           : contains(comment, kCartesian) ? std::optional(Coordinates::kCartesian)
                                                           : std::nullopt;
  if (coordinates) {
    TRY(state(statements.coordinates, *coordinates, where, "coordinates"));
  }
  const bool zyx = contains(comment, kZyx);
  if (!zyx && contains(comment, kEuler)) {
    return refused("Euler angles or parameters other than ZYX")
        .in(where)
        .at_row(line.number)
        .of("angles")
        .next("expected Euler ZYX or fixed XYZ");
  }
  const auto behind = zyx                         ? std::optional(BehindCoordinates::kEulerZyx)
                      : contains(comment, kFixed) ? std::optional(BehindCoordinates::kFixedXyz)
                      : contains(comment, kUncertain)
                          ? std::optional(BehindCoordinates::kUncertainties)
                          : std::nullopt;
  if (!behind) return {};
  return state(statements.behind, *behind, where, "columns behind the coordinates");
}

/// Our name for a column of another program; empty for a column that is ignored.
std::string known_column(const std::string& name) {
  static const std::map<std::string, std::string> kNames = {{"name", "name"},
                                                            {"point", "name"},
                                                            {"pointname", "name"},
                                                            {"pointid", "name"},
                                                            {"pointnumber", "name"},
                                                            {"target", "name"},
                                                            {"targetname", "name"},
                                                            {"frame", "name"},
                                                            {"framename", "name"},
                                                            {"radius", "r"},
                                                            {"u95", kU95},
                                                            {"u953d", kU95},
                                                            {"u95xyz", kU95},
                                                            {"u95total", kU95},
                                                            {"u95point", kU95},
                                                            {"u95x", kU95Axes[0]},
                                                            {"u95y", kU95Axes[1]},
                                                            {"u95z", kU95Axes[2]},
                                                            {"timestamp", kTimeStamp},
                                                            {"datetime", kTimeStamp},
                                                            {"temperature", kWeather[0]},
                                                            {"airtemperature", kWeather[0]},
                                                            {"pressure", kWeather[1]},
                                                            {"airpressure", kWeather[1]},
                                                            {"humidity", kWeather[2]},
                                                            {"relativehumidity", kWeather[2]}};
  static const std::vector<std::string> kSame = {"x",  "y",  "z",  "r",      "theta", "phi",   "ux",
                                                 "uy", "uz", "ur", "utheta", "uphi",  "sigma", "rx",
                                                 "ry", "rz", "qw", "qx",     "qy",    "qz"};
  if (const auto known = kNames.find(name); known != kNames.end()) return known->second;
  return std::find(kSame.begin(), kSame.end(), name) != kSame.end() ? name : "";
}

bool has_all(const std::vector<std::string>& columns, std::initializer_list<const char*> wanted) {
  return std::all_of(wanted.begin(), wanted.end(), [&](const char* name) {
    return std::find(columns.begin(), columns.end(), name) != columns.end();
  });
}

std::optional<Coordinates> coordinates_of(const std::vector<std::string>& columns) {
  if (has_all(columns, {"x", "y", "z"})) return Coordinates::kCartesian;
  if (has_all(columns, {"r", "theta", "phi"})) return Coordinates::kSpherical;
  if (has_all(columns, {"r", "theta", "z"})) return Coordinates::kCylindrical;
  return std::nullopt;
}

/// True if the column has a unit that is neither a length nor an angle.
bool has_no_length(const std::string& column) {
  return column == kTimeStamp ||
         std::find(kWeather.begin(), kWeather.end(), column) != kWeather.end() ||
         (column.size() == 2 && column.starts_with('q')) || column == "name";
}

/// A parsed header line; `columns` is empty if the line is no header.
struct Header {
  std::vector<std::string> columns;  // our names; an ignored column has its position as a name
  std::vector<std::string> units;
};

Header header_of(std::string_view line, char separator) {
  static const std::regex kTwoWords("(point|target|frame|group|collection)\\s+name",
                                    std::regex::icase);
  const std::string text = std::regex_replace(std::string(line), kTwoWords, "$1");
  const std::vector<std::string> fields = split_fields(text, separator);
  std::vector<std::string> names;
  for (const std::string& field : fields) names.push_back(column_name(field).name);
  const bool numbered_quaternion = has_all(names, {"q0", "q1", "q2", "q3"});
  Header header;
  for (std::size_t k = 0; k < fields.size(); ++k) {
    const bool of_quaternion = numbered_quaternion && names[k].size() == 2 && names[k][0] == 'q';
    const std::string known = of_quaternion && names[k][1] <= '3'
                                  ? fmt::format("q{}", "wxyz"[names[k][1] - '0'])
                                  : known_column(names[k]);
    header.columns.push_back(
        known.empty() ? fmt::format("({}) {}", header.columns.size() + 1, fields[k]) : known);
    header.units.push_back(known.empty() || has_no_length(known) ? ""
                                                                 : column_name(fields[k]).unit);
  }
  if (!has_all(header.columns, {"name"}) || !coordinates_of(header.columns)) return {};
  return header;
}

bool is_angle(const std::string& column) {
  return column.ends_with("theta") || column.ends_with("phi") ||
         (column.size() == 2 && column.starts_with('r'));
}

Status read_header_units(const Header& header, const std::string& where, int line,
                         Statements& statements) {
  for (std::size_t k = 0; k < header.units.size(); ++k) {
    if (header.units[k].empty()) continue;
    if (is_angle(header.columns[k])) {
      const bool radians = TRY(is_radian(header.units[k], where, line));
      TRY(state(statements.radians, radians, where, "angular unit"));
    } else {
      const LengthUnit unit = TRY(length_unit(header.units[k], where, line));
      TRY(state(statements.unit, unit, where, "unit"));
    }
  }
  return {};
}

/// Removes time stamps and empty fields from the end.
void drop_time_stamp(std::vector<std::string>& fields) {
  static const std::regex kStamp(R"(.*[/:].*|[AaPp]\.?[Mm]\.?|\d{4}-\d{2}-\d{2}.*)");
  while (fields.size() > kLeastFields &&
         (fields.back().empty() || std::regex_match(fields.back(), kStamp))) {
    fields.pop_back();
  }
}

/// The columns of a file without a header line, from its first row.
Result<std::vector<std::string>> positional_columns(const CsvTable::Row& row,
                                                    const Statements& statements,
                                                    const std::string& where) {
  const std::size_t count = row.fields.size();
  if (count + 1 == kLeastFields) {
    return refused("{} values, and no point has a name", count)
        .in(where)
        .at_row(row.line)
        .beyond(count, kLeastFields)
        .next(
            "put names of poses before them; or, where the rows of a list of joints belong to them "
            "in their order, put the lists side by side (paste JOINTS POINTS > TABLE) and name the "
            "columns: trammel convert --table TABLE --columns q1_deg,q2_deg,...,x_mm,y_mm,z_mm -o "
            "BATCH");
  }
  if (count < kLeastFields || count > kMostFields) {
    return refused(
               "{} values, expected {} to {}: [[collection] group] target, 3 coordinates, [3 "
               "uncertainties or angles]",
               count, kLeastFields, kMostFields)
        .in(where)
        .at_row(row.line)
        .beyond(count, count < kLeastFields ? kLeastFields : kMostFields);
  }
  const bool more_behind = count > kLeastFields + 2;
  if (more_behind && !statements.behind) {
    return refused(
               "3 values behind the coordinates, and nothing says whether they are uncertainties, "
               "fixed XYZ or Euler ZYX angles")
        .in(where)
        .at_row(row.line)
        .of("columns behind the coordinates");
  }
  std::vector<std::string> columns = {"collection", "group", "name"};
  columns.erase(columns.begin(),
                columns.begin() + 2 - static_cast<std::ptrdiff_t>((count - kLeastFields) % 3));
  const Coordinates coordinates = statements.coordinates.value_or(Coordinates::kCartesian);
  const auto append = [&](const CoordinateNames& names) {
    columns.insert(columns.end(), names.begin(), names.end());
  };
  append(coordinate_columns(coordinates));
  if (!more_behind) return columns;
  switch (*statements.behind) {
    case BehindCoordinates::kUncertainties:
      append(uncertainty_columns(coordinates));
      break;
    case BehindCoordinates::kFixedXyz:
      append({"rx", "ry", "rz"});
      break;
    case BehindCoordinates::kEulerZyx:
      append({"rz", "ry", "rx"});
      break;
  }
  return columns;
}

/// Refuses positions without any decimal point between commas: they may be fewer numbers with
/// decimal commas.
Status check_commas(const std::vector<CsvTable::Row>& rows, const std::string& where) {
  for (const CsvTable::Row& row : rows) {
    const auto name = std::find_if_not(row.fields.rbegin(), row.fields.rend(), is_number);
    const bool no_more_than_needed =
        row.fields.size() <= kLeastFields || name - row.fields.rbegin() <= 3;
    const auto pointed = [](const std::string& field) { return decimal_sign(field) == '.'; };
    if (no_more_than_needed || std::any_of(row.fields.rbegin(), name, pointed)) return {};
  }
  return refused("commas between all values and no decimal point: they may stand in numbers, too")
      .in(where)
      .at_row(rows.front().line)
      .next("name the columns in a first line (name,x,y,z), or separate values by ';'");
}

/// The header if there is one among the first lines, below the lines in which a program describes
/// the file; otherwise the first line of data.
std::vector<TextLine>::const_iterator first_of_table(const std::vector<TextLine>& lines) {
  constexpr int kMostAbove = 30;
  const auto is_data = [](const TextLine& line) { return !line.comment; };
  const auto first = std::find_if(lines.begin(), lines.end(), is_data);
  int above = 0;
  for (auto line = first; line != lines.end() && above < kMostAbove;
       line = std::find_if(line + 1, lines.end(), is_data)) {
    if (!header_of(line->text, separator_of(line->text)).columns.empty()) return line;
    ++above;
  }
  return first;
}

Status check_comments(const std::vector<TextLine>& lines, const std::string& where) {
  const auto comments = static_cast<std::size_t>(
      std::count_if(lines.begin(), lines.end(), [](const TextLine& line) { return line.comment; }));
  if (comments <= kMostComments) return {};
  return failure(ErrorCode::kTooLarge, "{} lines of comments, limit {}", comments, kMostComments)
      .in(where)
      .beyond(comments, kMostComments);
}

}  // namespace

CoordinateNames coordinate_columns(Coordinates coordinates) {
  if (coordinates == Coordinates::kCylindrical) return {"r", "theta", "z"};
  if (coordinates == Coordinates::kSpherical) return {"r", "theta", "phi"};
  return {"x", "y", "z"};
}

CoordinateNames uncertainty_columns(Coordinates coordinates) {
  if (coordinates == Coordinates::kCylindrical) return {"ur", "utheta", "uz"};
  if (coordinates == Coordinates::kSpherical) return {"ur", "utheta", "uphi"};
  return {"ux", "uy", "uz"};
}

Result<PointTable> take_apart(const std::string& text, const std::string& where,
                              const PointFileOptions& options) {
  const std::vector<TextLine> read = TRY(text_lines(text, where, kLongestLineOfPoints));
  const std::vector<TextLine>& lines = read;
  TRY(check_comments(lines, where));
  const auto first = first_of_table(lines);
  if (first == lines.end())
    return refused("no points, at least 1 is needed").in(where).beyond(0, 1);
  const char separator = separator_of(first->text);
  PointTable parts{{}, {options.unit, options.coordinates, options.behind, std::nullopt}, false};
  std::vector<CsvTable::Row> data = TRY(data_rows({first, lines.end()}, separator, where));
  std::vector<CsvTable::Row>& rows = data;
  Header header = header_of(first->text, separator);
  int header_line = first->number;
  if (!header.columns.empty()) rows.erase(rows.begin());
  for (const TextLine& line : lines) {
    if (!line.comment) continue;
    Header named = header_of(line.text, separator_of(line.text));
    const bool is_header = header.columns.empty() && !named.columns.empty() && !rows.empty() &&
                           named.columns.size() == rows.front().fields.size();
    if (is_header) {
      header = std::move(named);
      header_line = line.number;
    } else if (const Status said = read_statements(line, where, parts.statements); !said) {
      return tl::make_unexpected(said.error());
    }
  }
  if (rows.empty())
    return refused("no points below the header, at least 1 is needed").in(where).beyond(0, 1);
  parts.positional = header.columns.empty();
  if (parts.positional) {
    for (CsvTable::Row& row : rows) drop_time_stamp(row.fields);
    std::vector<std::string> columns =
        TRY(positional_columns(rows.front(), parts.statements, where));
    for (const CsvTable::Row& row : rows) {
      if (row.fields.size() == columns.size()) continue;
      return refused("{} values, the rows before have {}", row.fields.size(), columns.size())
          .in(where)
          .at_row(row.line)
          .beyond(row.fields.size(), columns.size());
    }
    if (separator == ',') {
      TRY(check_commas(rows, where));
    }
    header.columns = std::move(columns);
    header_line = rows.front().line;
  } else if (const Status units = read_header_units(header, where, header_line, parts.statements);
             !units) {
    return tl::make_unexpected(units.error());
  }
  TRY(state(parts.statements.coordinates, *coordinates_of(header.columns), where, "coordinates"));
  CsvTable table = TRY(CsvTable::from_rows(where, {header_line, header.columns}, rows, separator));
  parts.table = std::move(table);
  return parts;
}

}  // namespace trammel
