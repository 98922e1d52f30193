#include "server/measurement/point_list.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <map>
#include <regex>

#include "server/base/text_file.h"
#include "server/base/units.h"
#include "server/measurement/csv_table.h"
#include "server/measurement/text_lines.h"

namespace trammel {

namespace {

constexpr double kPositionLimit = 1e3;   // m, no tracker sees farther
constexpr double kUncertaintyLimit = 1;  // m
constexpr double kAngleLimit = 360;      // deg
constexpr double kInch = 0.0254;         // m
constexpr std::size_t kLeastFields = 4;
constexpr std::size_t kMostFields = 9;

using Names = std::array<std::string, 3>;

/// What the file and the caller say about it.
struct Statements {
  std::optional<LengthUnit> unit;
  std::optional<Coordinates> coordinates;
  std::optional<BehindCoordinates> behind;
  std::optional<bool> radians;
};

template <typename T>
Status state(std::optional<T>& known, T said, const std::string& where, const char* what) {
  if (known && *known != said) return refused("{}: two different statements of {}", where, what);
  known = said;
  return {};
}

Result<LengthUnit> length_unit(const std::string& word, const std::string& where, int line) {
  if (word == "mm" || word.starts_with("millimet")) return LengthUnit::kMillimetre;
  if (word == "m" || word.starts_with("meter") || word.starts_with("metre")) return LengthUnit::kMetre;
  if (word == "in" || word.starts_with("inch")) return LengthUnit::kInch;
  return refused("{} row {}: unit is '{}', expected mm, m or inch", where, line, word);
}

Result<bool> is_radian(const std::string& word, const std::string& where, int line) {
  if (word.starts_with("deg")) return false;
  if (word.starts_with("rad")) return true;
  return refused("{} row {}: angular unit is '{}', expected deg or rad", where, line, word);
}

bool contains(const std::string& text, const char* pattern) { return std::regex_search(text, std::regex(pattern)); }

std::string lower_case(std::string_view text) {
  std::string lower(text);
  std::transform(lower.begin(), lower.end(), lower.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return lower;
}

Status read_unit_statements(const std::string& comment, const std::string& where, int line, Statements& statements) {
  static const std::regex kUnits(R"((angular|angle)?\s*\bunits?\s*(?:[:=]|\bare\b|\bin\b)\s*([a-z]+))");
  for (auto at = std::sregex_iterator(comment.begin(), comment.end(), kUnits); at != std::sregex_iterator(); ++at) {
    if ((*at)[1].matched) {
      const Result<bool> radians = is_radian((*at)[2], where, line);
      if (!radians) return tl::make_unexpected(radians.error());
      if (const Status s = state(statements.radians, *radians, where, "the angular unit"); !s) return s;
    } else {
      const Result<LengthUnit> unit = length_unit((*at)[2], where, line);
      if (!unit) return tl::make_unexpected(unit.error());
      if (const Status s = state(statements.unit, *unit, where, "the unit"); !s) return s;
    }
  }
  return {};
}

Status read_statements(const TextLine& line, const std::string& where, Statements& statements) {
  const std::string comment = lower_case(line.text);
  if (const Status units = read_unit_statements(comment, where, line.number, statements); !units) return units;
  const auto coordinates = contains(comment, "cylindric")            ? std::optional(Coordinates::kCylindrical)
                           : contains(comment, "spherical|\\bpolar") ? std::optional(Coordinates::kSpherical)
                           : contains(comment, "cartesian")          ? std::optional(Coordinates::kCartesian)
                                                                     : std::nullopt;
  if (coordinates) {
    if (const Status s = state(statements.coordinates, *coordinates, where, "the coordinates"); !s) return s;
  }
  const bool zyx = contains(comment, R"(\bzyx\s+euler|\beuler\s+(angles\s+)?\(?zyx)");
  if (!zyx && contains(comment, R"(\beuler\b)")) {
    return refused("{} row {}: Euler angles or parameters other than ZYX; expected Euler ZYX or fixed XYZ", where,
                   line.number);
  }
  const auto behind = zyx ? std::optional(BehindCoordinates::kEulerZyx)
                      : contains(comment, R"(\bfixed\s+(xyz|angles)|\bxyz\s+fixed)")
                          ? std::optional(BehindCoordinates::kFixedXyz)
                      : contains(comment, "\\buncertaint") ? std::optional(BehindCoordinates::kUncertainties)
                                                           : std::nullopt;
  if (!behind) return {};
  return state(statements.behind, *behind, where, "what follows the coordinates");
}

/// Our name of a column, for what other programs call it; empty for one that is passed over.
std::string known_column(const std::string& name) {
  static const std::map<std::string, std::string> kNames = {
      {"name", "name"},       {"point", "name"}, {"pointname", "name"}, {"target", "name"},
      {"targetname", "name"}, {"frame", "name"}, {"framename", "name"}, {"radius", "r"}};
  static const std::vector<std::string> kSame = {"x",  "y",  "z",      "r",    "theta", "phi", "ux", "uy",
                                                 "uz", "ur", "utheta", "uphi", "sigma", "rx",  "ry", "rz"};
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

/// A header line taken apart; `columns` is empty when it is none.
struct Header {
  std::vector<std::string> columns;  // our names; a column that is passed over has its place as a name
  std::vector<std::string> units;
};

Header header_of(std::string_view line, char separator) {
  static const std::regex kTwoWords("(point|target|frame|group|collection)\\s+name", std::regex::icase);
  const std::string text = std::regex_replace(std::string(line), kTwoWords, "$1");
  Header header;
  for (const std::string& field : split_fields(text, separator)) {
    const ColumnName column = column_name(field);
    const std::string known = known_column(column.name);
    header.columns.push_back(known.empty() ? fmt::format("({}) {}", header.columns.size() + 1, field) : known);
    header.units.push_back(known.empty() ? "" : column.unit);
  }
  if (!has_all(header.columns, {"name"}) || !coordinates_of(header.columns)) return {};
  return header;
}

bool is_angle(const std::string& column) {
  return column.ends_with("theta") || column.ends_with("phi") || (column.size() == 2 && column.starts_with('r'));
}

Status read_header_units(const Header& header, const std::string& where, int line, Statements& statements) {
  for (std::size_t k = 0; k < header.units.size(); ++k) {
    if (header.units[k].empty()) continue;
    if (is_angle(header.columns[k])) {
      const Result<bool> radians = is_radian(header.units[k], where, line);
      if (!radians) return tl::make_unexpected(radians.error());
      if (const Status s = state(statements.radians, *radians, where, "the angular unit"); !s) return s;
    } else {
      const Result<LengthUnit> unit = length_unit(header.units[k], where, line);
      if (!unit) return tl::make_unexpected(unit.error());
      if (const Status s = state(statements.unit, *unit, where, "the unit"); !s) return s;
    }
  }
  return {};
}

/// Takes time stamps and empty fields off the end.
void drop_time_stamp(std::vector<std::string>& fields) {
  static const std::regex kStamp(R"(.*[/:].*|[AaPp]\.?[Mm]\.?|\d{4}-\d{2}-\d{2}.*)");
  while (fields.size() > kLeastFields && (fields.back().empty() || std::regex_match(fields.back(), kStamp))) {
    fields.pop_back();
  }
}

Names coordinate_columns(Coordinates coordinates) {
  if (coordinates == Coordinates::kCylindrical) return {"r", "theta", "z"};
  if (coordinates == Coordinates::kSpherical) return {"r", "theta", "phi"};
  return {"x", "y", "z"};
}

Names uncertainty_columns(Coordinates coordinates) {
  if (coordinates == Coordinates::kCylindrical) return {"ur", "utheta", "uz"};
  if (coordinates == Coordinates::kSpherical) return {"ur", "utheta", "uphi"};
  return {"ux", "uy", "uz"};
}

/// The columns of a file without a header line, from its first row.
Result<std::vector<std::string>> positional_columns(const CsvTable::Row& row, const Statements& statements,
                                                    const std::string& where) {
  const std::size_t count = row.fields.size();
  if (count < kLeastFields || count > kMostFields) {
    return refused(
        "{} row {}: {} values, expected {} to {}: [[collection] group] target, 3 coordinates, [3 uncertainties or "
        "angles]",
        where, row.line, count, kLeastFields, kMostFields);
  }
  const bool more_behind = count > kLeastFields + 2;
  if (more_behind && !statements.behind) {
    return refused(
        "{} row {}: 3 values behind the coordinates, and nothing says whether they are uncertainties, fixed XYZ or "
        "Euler ZYX angles",
        where, row.line);
  }
  std::vector<std::string> columns = {"collection", "group", "name"};
  columns.erase(columns.begin(), columns.begin() + 2 - static_cast<std::ptrdiff_t>((count - kLeastFields) % 3));
  const Coordinates coordinates = statements.coordinates.value_or(Coordinates::kCartesian);
  const auto append = [&](const Names& names) { columns.insert(columns.end(), names.begin(), names.end()); };
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

/// The file as a table with our column names, and what it says about itself.
struct PointTable {
  CsvTable table;
  Statements statements;
  bool positional = false;
};

Result<PointTable> take_apart(const std::string& text, const std::string& where, const PointFileOptions& options) {
  const std::vector<TextLine> lines = text_lines(text);
  const auto first = std::find_if(lines.begin(), lines.end(), [](const TextLine& line) { return !line.comment; });
  if (first == lines.end()) return refused("{}: no points, at least 1 is needed", where);
  const char separator = separator_of(first->text);
  PointTable parts{{}, {options.unit, options.coordinates, options.behind, std::nullopt}, false};
  std::vector<CsvTable::Row> rows;
  for (const TextLine& line : lines) {
    if (!line.comment) rows.push_back({line.number, split_fields(line.text, separator)});
  }
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
  if (rows.empty()) return refused("{}: no points below the header, at least 1 is needed", where);
  parts.positional = header.columns.empty();
  if (parts.positional) {
    for (CsvTable::Row& row : rows) drop_time_stamp(row.fields);
    Result<std::vector<std::string>> columns = positional_columns(rows.front(), parts.statements, where);
    if (!columns) return tl::make_unexpected(columns.error());
    for (const CsvTable::Row& row : rows) {
      if (row.fields.size() == columns->size()) continue;
      return refused("{} row {}: {} values, the rows before have {}", where, row.line, row.fields.size(),
                     columns->size());
    }
    header.columns = std::move(*columns);
    header_line = rows.front().line;
  } else if (const Status units = read_header_units(header, where, header_line, parts.statements); !units) {
    return tl::make_unexpected(units.error());
  }
  const Status coordinates =
      state(parts.statements.coordinates, *coordinates_of(header.columns), where, "the coordinates");
  if (!coordinates) return tl::make_unexpected(coordinates.error());
  Result<CsvTable> table = CsvTable::from_rows(where, {header_line, header.columns}, rows);
  if (!table) return tl::make_unexpected(table.error());
  parts.table = std::move(*table);
  return parts;
}

/// Reads rows of a table whose columns have our names.
class PointReader {
 public:
  PointReader(const PointTable& parts, double coverage)
      : table_(parts.table),
        positional_(parts.positional),
        coordinates_(*parts.statements.coordinates),
        length_(unit_length(parts.statements.unit.value_or(LengthUnit::kMillimetre))),
        angle_(parts.statements.radians.value_or(false) ? 1 : from_deg(1)),
        coverage_(coverage) {}

  [[nodiscard]] Status find_columns() {
    name_ = *table_.find("name");
    for (const std::string& column : coordinate_columns(coordinates_)) position_.push_back(*table_.find(column));
    const Names wanted = uncertainty_columns(coordinates_);
    auto uncertainties = table_.all_or_none({wanted.begin(), wanted.end()});
    if (!uncertainties) return tl::make_unexpected(uncertainties.error());
    auto angles = table_.all_or_none({"rx", "ry", "rz"});
    if (!angles) return tl::make_unexpected(angles.error());
    uncertainties_ = std::move(*uncertainties);
    angles_ = std::move(*angles);
    sigma_ = table_.find("sigma");
    return {};
  }

  [[nodiscard]] Result<NamedPoint> read(std::size_t row) const {
    NamedPoint point;
    point.row = table_.line(row);
    point.name = table_.field(row, name_);
    if (point.name.empty()) return table_.refuse(row, "name is empty");
    if (positional_ && is_number(point.name) && point.name.find('.') != std::string::npos) {
      return table_.refuse(
          row, "name is '{}', which looks like a coordinate; expected [[collection] group] target first", point.name);
    }
    const Result<Vector3> native = read_three(row, position_, coordinates_, kPositionLimit);
    if (!native) return tl::make_unexpected(native.error());
    if (coordinates_ != Coordinates::kCartesian && native->x() < 0) {
      return table_.refuse(row, "r is {:g}, must not be below 0", native->x() / length_);
    }
    point.p_W = cartesian(*native);
    if (const Status rotation = read_rotation(row, point); !rotation) return tl::make_unexpected(rotation.error());
    if (const Status sigma = read_sigma(row, *native, point); !sigma) return tl::make_unexpected(sigma.error());
    return point;
  }

 private:
  static double unit_length(LengthUnit unit) {
    return unit == LengthUnit::kMetre ? 1 : unit == LengthUnit::kInch ? kInch : from_mm(1);
  }

  /// Three numbers in m and rad; which of them are angles follows from the coordinates.
  [[nodiscard]] Result<Vector3> read_three(std::size_t row, const std::vector<std::size_t>& columns,
                                           Coordinates coordinates, double length_limit) const {
    Vector3 values;
    for (std::size_t k = 0; k < 3; ++k) {
      const bool angle =
          (k == 1 && coordinates != Coordinates::kCartesian) || (k == 2 && coordinates == Coordinates::kSpherical);
      const double scale = angle ? angle_ : length_;
      const Result<double> value =
          table_.number(row, columns[k], (angle ? from_deg(kAngleLimit) : length_limit) / scale);
      if (!value) return tl::make_unexpected(value.error());
      values(static_cast<Eigen::Index>(k)) = *value * scale;
    }
    return values;
  }

  [[nodiscard]] Vector3 cartesian(const Vector3& native) const {
    const double r = native.x();
    const double theta = native.y();
    if (coordinates_ == Coordinates::kCylindrical) return {r * std::cos(theta), r * std::sin(theta), native.z()};
    if (coordinates_ == Coordinates::kCartesian) return native;
    const double phi = native.z();
    return {r * std::sin(phi) * std::cos(theta), r * std::sin(phi) * std::sin(theta), r * std::cos(phi)};
  }

  [[nodiscard]] Status read_rotation(std::size_t row, NamedPoint& point) const {
    if (angles_.empty()) return {};
    Vector3 angles;
    for (std::size_t k = 0; k < 3; ++k) {
      const Result<double> value = table_.number(row, angles_[k], from_deg(kAngleLimit) / angle_);
      if (!value) return tl::make_unexpected(value.error());
      angles(static_cast<Eigen::Index>(k)) = *value * angle_;
    }
    point.R_W = pose_zyx(Vector3::Zero(), angles.z(), angles.y(), angles.x()).linear();
    return {};
  }

  [[nodiscard]] Status read_sigma(std::size_t row, const Vector3& native, NamedPoint& point) const {
    if (sigma_ && !table_.field(row, *sigma_).empty()) {
      const Result<double> sigma = table_.number(row, *sigma_, kUncertaintyLimit / length_);
      if (!sigma) return tl::make_unexpected(sigma.error());
      if (*sigma <= 0) return table_.refuse(row, "sigma is {:g}, must be above 0", *sigma);
      point.sigma = *sigma * length_;
    }
    if (uncertainties_.empty()) return {};
    const Result<Vector3> read = read_three(row, uncertainties_, coordinates_, kUncertaintyLimit);
    if (!read) return tl::make_unexpected(read.error());
    for (Eigen::Index k = 0; k < 3; ++k) {
      if ((*read)(k) >= 0) continue;
      const std::size_t column = uncertainties_[static_cast<std::size_t>(k)];
      return table_.refuse(row, "{} is {}, must not be below 0", table_.columns()[column], table_.field(row, column));
    }
    Vector3 along = *read;  // m, along the three directions of the coordinates
    if (coordinates_ == Coordinates::kCylindrical) along.y() *= native.x();
    if (coordinates_ == Coordinates::kSpherical) {
      along.y() *= native.x() * std::abs(std::sin(native.z()));
      along.z() *= native.x();
    }
    if (along.norm() > 0) point.sigma = along.norm() / std::sqrt(3.0) / coverage_;
    return {};
  }

  const CsvTable& table_;
  bool positional_;
  Coordinates coordinates_;
  double length_;  // m in a unit of the file
  double angle_;   // rad in a unit of the file
  double coverage_;
  std::size_t name_ = 0;
  std::vector<std::size_t> position_, uncertainties_, angles_;
  std::optional<std::size_t> sigma_;
};

}  // namespace

Result<PointList> parse_points(const std::string& text, const std::string& where, const PointFileOptions& options) {
  if (!(options.coverage > 0)) return refused("{}: coverage factor {:g}, must be above 0", where, options.coverage);
  const Result<PointTable> parts = take_apart(text, where, options);
  if (!parts) return tl::make_unexpected(parts.error());
  PointReader reader(*parts, options.coverage);
  if (const Status found = reader.find_columns(); !found) return tl::make_unexpected(found.error());
  PointList list{where, {}};
  std::map<std::string, int> row_of_name;
  for (std::size_t row = 0; row < parts->table.size(); ++row) {
    Result<NamedPoint> point = reader.read(row);
    if (!point) return tl::make_unexpected(point.error());
    const auto [earlier, is_new] = row_of_name.emplace(point->name, point->row);
    if (!is_new) return parts->table.refuse(row, "name '{}' is already that of row {}", point->name, earlier->second);
    list.points.push_back(std::move(*point));
  }
  return list;
}

Result<PointList> read_points(const std::string& path, const PointFileOptions& options) {
  return read_text_file(path).and_then([&](const std::string& text) { return parse_points(text, path, options); });
}

Result<MeasurementBatch> join_points(const PointList& points, const JointList& commanded) {
  std::map<std::string, const CommandedPose*> pose_of_id;
  for (const CommandedPose& pose : commanded.poses) {
    const auto [earlier, is_new] = pose_of_id.emplace(pose.pose_id, &pose);
    if (is_new) continue;
    return refused("{} row {}: pose_id '{}' is already that of row {}", commanded.where, pose.row, pose.pose_id,
                   earlier->second->row);
  }
  if (points.points.empty()) return refused("{}: no points, at least 1 is needed", points.where);
  MeasurementBatch batch;
  batch.id = std::filesystem::path(points.where).stem().string();
  batch.where = points.where;
  batch.joint_types = commanded.joint_types;
  for (const NamedPoint& point : points.points) {
    const auto pose = pose_of_id.find(point.name);
    if (pose == pose_of_id.end()) {
      return refused("{} row {}: point '{}' has no pose of that pose_id in {}", points.where, point.row, point.name,
                     commanded.where);
    }
    Measurement measurement;
    measurement.pose_id = point.name;
    measurement.context = pose->second->context;
    measurement.context.index = static_cast<int>(batch.measurements.size());
    measurement.p_W = point.p_W;
    measurement.R_WT = point.R_W;
    measurement.sigma = point.sigma;
    measurement.row = point.row;
    batch.measurements.push_back(std::move(measurement));
  }
  batch.source_text = to_csv(batch);
  return batch;
}

}  // namespace trammel
