#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <filesystem>
#include <map>
#include <numeric>

#include "server/base/text_file.h"
#include "server/base/units.h"
#include "server/measurement/files/batch_file.h"
#include "server/measurement/files/csv_dialect.h"
#include "server/measurement/files/csv_table.h"
#include "server/measurement/files/text_lines.h"
#include "server/robot/three_numbers.h"

namespace trammel {

namespace {

constexpr double kFarthest = 1e3;   // m
constexpr double kTurnsLimit = 10;  // of a joint
constexpr std::size_t kPositionalJoints = 6;
constexpr std::size_t kFewestColumns = 9;    // of a layout by position
constexpr std::size_t kColumnsOfPoses = 18;  // columns of the layout with orientations
constexpr double kMetresPerInch = 0.0254;    // m
constexpr std::size_t kMostTcps = 2;         // more, another one in most rows, are none
constexpr const char* kNameTheColumns =
    "name the columns in the first line: J1 ... J6, X, Y, Z, and the angles A B C, W P R, O A T, "
    "Rx Ry Rz (deg) or rvx_rad rvy_rad rvz_rad";

/// A column and the factor from its unit to ours: rad if `angle`, else m.
struct ScaledColumn {
  std::size_t column = 0;
  double scale = 1;
  bool angle = false;
};

struct RoboDkColumns {
  std::vector<ScaledColumn> joints, position, angles;
  std::vector<std::size_t> quaternion, tcp, extra;
  std::vector<std::string> extra_names;
  std::optional<std::size_t> pose_id;
  const ThreeNumbers* way = nullptr;  ///< the form of the orientation in `angles`
};

/// The column with the unit that its header names, or `unit`.
Result<ScaledColumn> scaled(const CsvTable& table, std::size_t column, std::string unit) {
  if (const std::string said = column_name(table.columns()[column]).unit; !said.empty()) {
    const bool angle = unit == "deg" || unit == "rad";
    const bool fits = angle ? said == "deg" || said == "rad" || said == "mm"
                            : said == "mm" || said == "m" || said == "in";
    if (!fits) {
      return refused("column {}: unit '{}', expected {}", table.columns()[column], said,
                     angle ? "deg or rad, of a rail mm" : "mm, m or in")
          .in(table.where())
          .of(table.columns()[column])
          .with_text(said);
    }
    unit = said;
  }
  if (unit == "deg") return ScaledColumn{column, from_deg(1), true};
  if (unit == "rad") return ScaledColumn{column, 1, true};
  if (unit == "m") return ScaledColumn{column, 1, false};
  if (unit == "in") return ScaledColumn{column, kMetresPerInch, false};
  return ScaledColumn{column, from_mm(1), false};
}

/// Columns by the names in the first line.
class NamedColumns {
 public:
  explicit NamedColumns(const CsvTable& table) : table_(table) {
    for (const std::string& column : table.columns()) names_.push_back(column_name(column).name);
  }

  [[nodiscard]] Result<RoboDkColumns> find() {
    TRY(find_joints());
    TRY(find_three({"x", "y", "z"}, "mm", found_.position));
    if (found_.position.empty()) return no_position();
    TRY(find_orientation());
    for (const char* name : {"poseid", "id", "name", "point", "target"}) {
      if (!found_.pose_id) found_.pose_id = find_name(name);
    }
    if (found_.pose_id) used_.push_back(*found_.pose_id);
    for (std::size_t column = 0; column < names_.size(); ++column) {
      if (std::find(used_.begin(), used_.end(), column) != used_.end()) continue;
      found_.extra.push_back(column);
      found_.extra_names.push_back(table_.columns()[column]);
    }
    return found_;
  }

 private:
  [[nodiscard]] std::optional<std::size_t> find_name(const std::string& name) const {
    const auto at = std::find(names_.begin(), names_.end(), name);
    if (at == names_.end()) return std::nullopt;
    return static_cast<std::size_t>(at - names_.begin());
  }

  [[nodiscard]] Failure no_position() const {
    Error missing = table_.require("X").error();
    missing.next += fmt::format("; {}", kNameTheColumns);
    return Failure(std::move(missing));
  }

  [[nodiscard]] Status find_joints() {
    std::map<std::size_t, std::size_t> column_of_joint;
    for (std::size_t column = 0; column < names_.size(); ++column) {
      const std::optional<int> number = joint_number(names_[column]);
      if (!number) continue;
      if (*number == 0)
        return refused("column {}: joints count from 1", table_.columns()[column])
            .in(table_.where())
            .of(table_.columns()[column])
            .next("name the columns J1, J2 and so on; a column of no joint by another letter");
      const auto [earlier, is_new] =
          column_of_joint.emplace(static_cast<std::size_t>(*number), column);
      if (is_new) continue;
      return refused("two columns for joint {}: {} and {}", *number,
                     table_.columns()[earlier->second], table_.columns()[column])
          .in(table_.where())
          .of(table_.columns()[column])
          .next("is one of them a quaternion's? Name its columns qw, qx, qy, qz");
    }
    for (const auto& [number, column] : column_of_joint) {
      if (number != found_.joints.size() + 1) {
        return refused("missing column J{} before {}", found_.joints.size() + 1,
                       table_.columns()[column])
            .in(table_.where())
            .of(fmt::format("J{}", found_.joints.size() + 1));
      }
      const ScaledColumn joint = TRY(scaled(table_, column, "deg"));
      found_.joints.push_back(joint);
      used_.push_back(column);
    }
    return {};
  }

  /// All three or none of the columns. Refuses a column that occurs twice.
  [[nodiscard]] Status find_three(const std::array<std::string, 3>& wanted, const std::string& unit,
                                  std::vector<ScaledColumn>& found) {
    std::vector<ScaledColumn> columns;
    for (const std::string& name : wanted) {
      if (std::count(names_.begin(), names_.end(), name) > 1) {
        return refused("column {} appears twice", name).in(table_.where()).of(name);
      }
      const auto column = find_name(name);
      if (!column) continue;
      const ScaledColumn one = TRY(scaled(table_, *column, unit));
      if (one.angle == (unit == "mm")) {
        return refused("column {} is a length, expected deg or rad", table_.columns()[*column])
            .in(table_.where())
            .of(table_.columns()[*column]);
      }
      columns.push_back(one);
    }
    if (columns.size() == 1 || columns.size() == 2) {
      return refused("{} of the columns {}; they come all together or not at all", columns.size(),
                     fmt::join(wanted, ", "))
          .in(table_.where())
          .of(wanted[0])
          .beyond(columns.size(), 3);
    }
    for (const ScaledColumn& column : columns) used_.push_back(column.column);
    found = std::move(columns);
    return {};
  }

  [[nodiscard]] Status find_orientation() {
    // Refuses an incomplete set of three columns, unless its columns belong to another complete
    // set: `a` of `o a t`.
    for (const bool complete : {true, false}) {
      for (const ThreeNumbers& way : ways_of_three_numbers()) {
        for (const std::array<std::string, 3>& names : way.columns) {
          if (has_all(names) != complete || (!complete && found_.way != nullptr)) continue;
          std::vector<ScaledColumn> angles;
          TRY(find_three(names, way.is_vector ? "rad" : "deg", angles));
          if (angles.empty()) continue;
          if (found_.way != nullptr) return two_orientations();
          found_.way = &way;
          found_.angles = std::move(angles);
        }
      }
    }
    for (const char* name : {"qw", "qx", "qy", "qz"}) {
      if (const auto column = find_name(name)) found_.quaternion.push_back(*column);
    }
    if (found_.quaternion.empty()) return {};
    if (found_.quaternion.size() != 4) {
      return refused("{} of the columns qw, qx, qy, qz; they come all together or not at all",
                     found_.quaternion.size())
          .in(table_.where())
          .of("qw")
          .beyond(found_.quaternion.size(), 4);
    }
    used_.insert(used_.end(), found_.quaternion.begin(), found_.quaternion.end());
    if (found_.way != nullptr) return two_orientations();
    return {};
  }

  [[nodiscard]] bool has_all(const std::array<std::string, 3>& names) const {
    return std::all_of(names.begin(), names.end(),
                       [&](const std::string& name) { return find_name(name).has_value(); });
  }

  [[nodiscard]] Failure two_orientations() const {
    return refused("two orientations")
        .in(table_.where())
        .of("orientation")
        .next(
            "expected one of A B C, W P R, O A T, Rx Ry Rz, rvx_rad rvy_rad rvz_rad, qw qx qy qz");
  }

  const CsvTable& table_;
  std::vector<std::string> names_;
  std::vector<std::size_t> used_;
  RoboDkColumns found_;
};

/// Names for the columns of the layouts by position; empty for any other number of columns.
std::vector<std::string> positional_names(std::size_t count) {
  std::vector<std::string> names;
  for (std::size_t j = 1; j <= kPositionalJoints; ++j) names.push_back(fmt::format("J{}", j));
  const bool full_pose = count == kColumnsOfPoses;
  const auto append = [&](const std::string& prefix) {
    for (const char* axis : {"x", "y", "z"})
      names.push_back(fmt::format("{}{}{}", prefix, axis, "_mm"));
    if (!full_pose) return;
    for (const char* axis : {"rx", "ry", "rz"})
      names.push_back(fmt::format("{}{}{}", prefix, axis, "_rad"));
  };
  append("");
  if (count != 9) append("tcp_");
  return names.size() == count ? names : std::vector<std::string>{};
}

/// Refuses numbers between commas without any decimal point: they could also be half as many
/// numbers with decimal commas.
Status check_commas_of_columns(const std::vector<CsvTable::Row>& rows, const std::string& where) {
  for (const CsvTable::Row& row : rows) {
    const auto pointed = [](const std::string& field) { return decimal_sign(field) == '.'; };
    if (row.fields.size() <= kFewestColumns ||
        std::any_of(row.fields.begin(), row.fields.end(), pointed))
      return {};
  }
  return refused("commas between all values and no decimal point: they may stand in numbers, too")
      .in(where)
      .at_row(rows.front().line)
      .next("name the columns in a first line (J1 ... X Y Z), or separate values by ';'");
}

/// The file as a table; by position, with the names above.
struct RoboDkTable {
  CsvTable table;
  bool positional = false;
};

/// True if a column is named as a joint. The export's own names (Axis-1, mx, tx) tell the order.
bool names_joints(const std::vector<std::string>& fields) {
  const auto is_named = [&](const auto& holds) {
    return std::any_of(fields.begin(), fields.end(),
                       [&](const std::string& field) { return holds(column_name(field).name); });
  };
  return is_named([](const std::string& name) { return joint_number(name) > 0; }) &&
         !is_named([](const std::string& name) { return name == "mx"; });
}

Result<RoboDkTable> take_apart(const std::string& text, const std::string& where) {
  const std::vector<TextLine> first = first_lines(text, 1);
  if (first.empty()) return refused("empty file, expected joints and measured positions").in(where);
  const char separator = separator_of(first.front().text);
  std::vector<CsvTable::Row> read =
      TRY(text_lines(text, where).and_then([&](const std::vector<TextLine>& lines) {
        return data_rows(lines, separator, where);
      }));
  std::vector<CsvTable::Row>& rows = read;
  CsvTable::Row header = rows.front();
  const bool has_header =
      !std::all_of(header.fields.begin(), header.fields.end(), [&](const std::string& field) {
        return is_number(separator == ',' ? field : with_decimal_point(field));
      });
  if (has_header) rows.erase(rows.begin());
  if (rows.empty())
    return refused("no measurements below the header, at least 1 is needed").in(where).beyond(0, 1);
  const bool named = names_joints(header.fields);
  if (!named) {
    header.fields = positional_names(header.fields.size());
    if (header.fields.empty()) {
      return refused("{} columns and none named J1; without names expected 9, 12 or 18",
                     rows.front().fields.size())
          .in(where)
          .of("J1")
          .with_value(rows.front().fields.size())
          .at_row(header.line);
    }
    if (separator == ',' && !has_header) {
      TRY(check_commas_of_columns(rows, where));
    }
  }
  return CsvTable::from_rows(where, header, rows, separator).map([&](CsvTable table) {
    return RoboDkTable{std::move(table), !named};
  });
}

/// The columns of the layouts by position. The TCP columns are separate, and kept.
Result<RoboDkColumns> find_columns(const RoboDkTable& parts) {
  Result<RoboDkColumns> columns = NamedColumns(parts.table).find();
  if (columns && parts.positional) columns->tcp = columns->extra;
  return columns;
}

Result<double> read_scaled(const CsvTable& table, std::size_t row, const ScaledColumn& column,
                           double angle_limit) {
  const double limit = column.angle ? angle_limit : kFarthest;
  return table.number(row, column.column, limit / column.scale).map([&](double value) {
    return value * column.scale;
  });
}

Result<Vector3> read_three(const CsvTable& table, std::size_t row,
                           const std::vector<ScaledColumn>& columns) {
  Vector3 values;
  for (std::size_t k = 0; k < 3; ++k) {
    const double value = TRY(read_scaled(table, row, columns[k], 2 * kPi));
    values(static_cast<Eigen::Index>(k)) = value;
  }
  return values;
}

Result<std::optional<Matrix3>> read_rotation(const CsvTable& table, std::size_t row,
                                             const RoboDkColumns& columns) {
  if (!columns.quaternion.empty()) {
    return table.rotation(row, columns.quaternion).map([](const Matrix3& R) {
      return std::optional(R);
    });
  }
  if (columns.way == nullptr) return std::optional<Matrix3>();
  return read_three(table, row, columns.angles).map([&](const Vector3& angles) {
    return std::optional<Matrix3>(columns.way->rotation(angles).toRotationMatrix());
  });
}

Result<Measurement> read_measurement(const CsvTable& table, std::size_t row,
                                     const RoboDkColumns& columns) {
  Measurement measurement;
  measurement.row = table.line(row);
  std::string pose_id = TRY(columns.pose_id ? table.name(row, *columns.pose_id) : std::string());
  measurement.pose_id = pose_id.empty() ? fmt::format("{}", row + 1) : std::move(pose_id);
  measurement.context.index = static_cast<int>(row);
  measurement.context.q.resize(static_cast<Eigen::Index>(columns.joints.size()));
  for (std::size_t j = 0; j < columns.joints.size(); ++j) {
    const double value = TRY(read_scaled(table, row, columns.joints[j], kTurnsLimit * 2 * kPi));
    measurement.context.q(static_cast<Eigen::Index>(j)) = value;
  }
  const Vector3 position = TRY(read_three(table, row, columns.position));
  measurement.p_W = position;
  std::optional<Matrix3> rotation = TRY(read_rotation(table, row, columns));
  measurement.R_WT = rotation;
  for (const std::size_t column : columns.extra)
    measurement.extra.push_back(table.field(row, column));
  return measurement;
}

/// Names a tool for each TCP if there are several. Refuses a TCP that differs in most rows, since
/// it is not a tool.
Status name_tools(const CsvTable& table, const std::vector<std::size_t>& tcp,
                  MeasurementBatch& batch) {
  std::map<std::vector<double>, std::size_t> tools;
  for (std::size_t row = 0; row < table.size(); ++row) {
    std::vector<double> tool;
    for (const std::size_t column : tcp) {
      const double value = TRY(table.number(row, column));
      tool.push_back(value);
    }
    const std::size_t number = tools.emplace(std::move(tool), tools.size() + 1).first->second;
    batch.measurements[row].context.tool = fmt::format("tcp-{}", number);
  }
  if (tools.size() > kMostTcps && 2 * tools.size() > table.size()) {
    return refused("column {} and the next ones would be the TCP: {} different ones in {} rows",
                   tcp.front() + 1, tools.size(), table.size())
        .in(table.where())
        .of(table.columns()[tcp.front()])
        .beyond(tools.size(), kMostTcps);
  }
  if (tools.size() > 1) return {};
  for (Measurement& m : batch.measurements) m.context.tool.clear();
  return {};
}

Result<MeasurementBatch> batch_of(const RoboDkTable& parts, const std::string& text,
                                  const std::string& where) {
  const RoboDkColumns columns = TRY(find_columns(parts));
  MeasurementBatch batch;
  batch.id = std::filesystem::path(where).stem().string();
  batch.where = where;
  batch.source_text = text;
  batch.extra_columns = columns.extra_names;
  for (const ScaledColumn& joint : columns.joints) {
    batch.joint_types.push_back(joint.angle ? JointType::kRevolute : JointType::kPrismatic);
  }
  std::map<std::string, int> row_of_pose;
  for (std::size_t row = 0; row < parts.table.size(); ++row) {
    Measurement measurement = TRY(read_measurement(parts.table, row, columns));
    const auto [earlier, is_new] = row_of_pose.emplace(measurement.pose_id, measurement.row);
    if (!is_new) {
      return parts.table
          .refuse(row, "pose_id '{}' is already that of row {}", measurement.pose_id,
                  earlier->second)
          .of("pose_id")
          .with_text(measurement.pose_id);
    }
    batch.measurements.push_back(std::move(measurement));
  }
  TRY(name_tools(parts.table, columns.tcp, batch));
  return batch;
}

}  // namespace

Result<MeasurementBatch> parse_robodk_csv(const std::string& text, const std::string& where) {
  const RoboDkTable parts = TRY(take_apart(text, where));
  Result<MeasurementBatch> batch = batch_of(parts, text, where);
  if (batch || !parts.positional) return batch;
  Error failed = batch.error();
  failed.next = fmt::format(
      "no column is named J1, so they were taken by their places, as RoboDK "
      "writes them (six joints, X Y Z{}, the TCP's): {}",
      parts.table.columns().size() == kColumnsOfPoses ? " Rx Ry Rz" : "", kNameTheColumns);
  return Failure(std::move(failed));
}

Result<MeasurementBatch> read_robodk_csv(const std::string& path) {
  return read_text_file(path).and_then(
      [&](const std::string& text) { return parse_robodk_csv(text, path); });
}

}  // namespace trammel
