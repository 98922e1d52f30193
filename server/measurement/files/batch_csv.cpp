#include <algorithm>
#include <filesystem>
#include <limits>
#include <map>
#include <set>

#include "server/base/text_file.h"
#include "server/base/units.h"
#include "server/measurement/files/batch_columns.h"
#include "server/measurement/files/batch_file.h"
#include "server/measurement/files/csv_dialect.h"
#include "server/measurement/files/csv_table.h"
#include "server/measurement/files/text_lines.h"
#include "server/measurement/measurement.h"
#include "server/measurement/pose_columns.h"
#include "server/robot/three_numbers.h"

namespace trammel {

namespace {

constexpr double kPositionLimitMm = 1e6;  // beyond the range of any tracker
constexpr double kSigmaLimitMm =
    5;  // above any instrument, and below micrometres read as millimetres
constexpr std::size_t kMostMeasurements =
    100'000;  // rows of one file: five times the limit of one training

/// The columns of an orientation in the form of three numbers: `a_deg`, `b_deg`, `c_deg`.
struct ThreeColumns {
  const ThreeNumbers* way = nullptr;
  std::vector<std::size_t> columns;
  double per_unit = 1;  ///< rad
};

/// The columns of one batch file.
struct BatchColumns {
  PoseColumns pose;
  std::vector<std::size_t> position, quaternion, extra;
  ThreeColumns three;  // the orientation in these columns or the quaternion
  std::optional<std::size_t> sigma, set, session;
  std::optional<std::size_t> distance, touch, anchor, minus_pose, from_pose;

  [[nodiscard]] bool has_gauges() const { return distance || touch; }
};

/// The position, which a batch of gauges may be without.
Status find_position(const CsvTable& table, BatchColumns& columns) {
  if (columns.has_gauges()) {
    std::vector<std::size_t> position = TRY(table.all_or_none(kPositionColumns));
    columns.position = std::move(position);
    return {};
  }
  for (const std::string& name : kPositionColumns) {
    const std::size_t column = TRY(table.require(name));
    columns.position.push_back(column);
  }
  return {};
}

/// The orientation in three columns with names that state the form and the unit. Refuses two such
/// sets, and an incomplete rotation vector.
Result<ThreeColumns> find_three(const CsvTable& table) {
  ThreeColumns found;
  for (const ThreeNumbers& way : ways_of_three_numbers()) {
    for (const auto& names : way.columns) {
      for (const auto& [unit, per_unit] : {std::pair("deg", from_deg(1)), std::pair("rad", 1.0)}) {
        std::vector<std::string> wanted;
        for (const std::string& name : names) wanted.push_back(fmt::format("{}_{}", name, unit));
        const bool all = std::all_of(wanted.begin(), wanted.end(), [&](const std::string& name) {
          return table.find(name).has_value();
        });
        if (!all && !way.is_vector) continue;
        std::vector<std::size_t> columns = TRY(table.all_or_none(wanted));
        if (columns.empty()) continue;
        if (found.way != nullptr)
          return refused("two orientations, {} and {}", found.way->name, way.name)
              .in(table.where())
              .of(wanted.front());
        found = {&way, std::move(columns), per_unit};
      }
    }
  }
  return found;
}

Result<BatchColumns> find_columns(const CsvTable& table) {
  PoseColumns pose = TRY(PoseColumns::find(table));
  TRY(pose.require_joints(table));
  BatchColumns columns{std::move(pose),
                       {},
                       {},
                       {},
                       {},
                       table.find("sigma_mm"),
                       table.find("set"),
                       table.find("session_id"),
                       table.find("distance_mm"),
                       table.find("touch_mm"),
                       table.find("anchor_id"),
                       table.find("minus_pose_id"),
                       table.find("from_pose_id")};
  TRY(find_position(table, columns));
  std::vector<std::size_t> quaternion = TRY(table.all_or_none(kQuaternionColumns));
  columns.quaternion = std::move(quaternion);
  ThreeColumns three = TRY(find_three(table));
  columns.three = std::move(three);
  if (!columns.quaternion.empty() && columns.three.way != nullptr)
    return refused("two orientations, a quaternion and {}", columns.three.way->name)
        .in(table.where())
        .of(table.columns()[columns.three.columns.front()]);

  std::vector<bool> used(table.columns().size(), false);
  for (const std::size_t column : columns.pose.used()) used[column] = true;
  for (const std::size_t column : columns.position) used[column] = true;
  for (const std::size_t column : columns.quaternion) used[column] = true;
  for (const std::size_t column : columns.three.columns) used[column] = true;
  for (const auto& column :
       {columns.sigma, columns.set, columns.session, columns.distance, columns.touch,
        columns.anchor, columns.minus_pose, columns.from_pose}) {
    if (column) used[*column] = true;
  }
  for (std::size_t column = 0; column < used.size(); ++column) {
    if (!used[column]) columns.extra.push_back(column);
  }
  return columns;
}

/// True if the row has a value in one of these columns.
bool says(const CsvTable& table, std::size_t row, const std::vector<std::size_t>& columns) {
  return std::any_of(columns.begin(), columns.end(),
                     [&](std::size_t column) { return !table.field(row, column).empty(); });
}

bool says(const CsvTable& table, std::size_t row, const std::optional<std::size_t>& column) {
  return column && !table.field(row, *column).empty();
}

Status read_position(const CsvTable& table, std::size_t row, const BatchColumns& columns,
                     Measurement& measurement) {
  for (std::size_t k = 0; k < 3; ++k) {
    const double value = TRY(table.number(row, columns.position[k], kPositionLimitMm));
    measurement.p_W(static_cast<Eigen::Index>(k)) = from_mm(value);
  }
  if (says(table, row, columns.quaternion)) {
    const Matrix3 R_WT = TRY(table.rotation(row, columns.quaternion));
    measurement.R_WT = R_WT;
  }
  if (!says(table, row, columns.three.columns)) return {};
  constexpr double kMost = 4 * kPi;
  const double per_unit = columns.three.per_unit;
  Vector3 rad;
  for (std::size_t k = 0; k < 3; ++k) {
    const double value = TRY(table.number(row, columns.three.columns[k], kMost / per_unit));
    rad(static_cast<Eigen::Index>(k)) = value * per_unit;
  }
  measurement.R_WT = columns.three.way->rotation(rad).toRotationMatrix();
  return {};
}

/// Settles what a distance is: to an anchor, from another pose, or, if it is 0, a contact.
Status read_kind_of_distance(const CsvTable& table, std::size_t row, const BatchColumns& columns,
                             Gauge& gauge) {
  if (says(table, row, columns.from_pose)) {
    for (const auto& [column, name] :
         {std::pair(columns.anchor, "anchor_id"), std::pair(columns.minus_pose, "minus_pose_id")})
      if (says(table, row, column))
        return table.refuse(row, "{} beside from_pose_id", name)
            .of(name)
            .next(
                "a distance is to an anchor, or from the pose from_pose_id: write a row for each");
    gauge.kind = Gauge::Kind::kApart;
    gauge.minus_pose = table.field(row, *columns.from_pose);
  }
  if (!gauge.minus_pose.empty() && gauge.kind != Gauge::Kind::kApart) return {};
  if (gauge.value == 0 && gauge.kind == Gauge::Kind::kDistance) {
    gauge.kind = Gauge::Kind::kContact;
  } else if (gauge.value <= 0) {
    return table.refuse(row, "distance_mm is {:g}, must be above 0", to_mm(gauge.value))
        .of("distance_mm")
        .beyond(to_mm(gauge.value), 0)
        .next("0 with an anchor_id says that the tip met that point");
  }
  return {};
}

/// The number of the row. Refuses a row that also has a position.
Result<Gauge> read_gauge(const CsvTable& table, std::size_t row, const BatchColumns& columns) {
  const bool distance = says(table, row, columns.distance);
  const char* name = distance ? "distance_mm" : "touch_mm";
  if (distance && says(table, row, columns.touch))
    return table.refuse(row, "distance_mm and touch_mm in one row")
        .of("touch_mm")
        .next("write a row for each");
  if (says(table, row, columns.position) || says(table, row, columns.quaternion) ||
      says(table, row, columns.three.columns))
    return table.refuse(row, "{} beside a position", name).of(name).next("write a row for each");
  Gauge gauge;
  gauge.kind = distance ? Gauge::Kind::kDistance : Gauge::Kind::kTouch;
  const double value =
      TRY(table.number(row, distance ? *columns.distance : *columns.touch, kPositionLimitMm));
  gauge.value = from_mm(value);
  if (says(table, row, columns.anchor)) {
    std::string anchor = TRY(table.name(row, *columns.anchor));
    gauge.anchor = std::move(anchor);
  }
  if (says(table, row, columns.minus_pose))
    gauge.minus_pose = table.field(row, *columns.minus_pose);
  if (distance) {
    TRY(read_kind_of_distance(table, row, columns, gauge));
  } else if (says(table, row, columns.from_pose)) {
    return table.refuse(row, "from_pose_id beside touch_mm")
        .of("from_pose_id")
        .next("a distance from another pose is a distance_mm");
  }
  return gauge;
}

Status read_sigma(const CsvTable& table, std::size_t row, const BatchColumns& columns,
                  Measurement& measurement) {
  if (!says(table, row, columns.sigma)) return {};
  const double sigma = TRY(table.number(row, *columns.sigma, kSigmaLimitMm));
  if (sigma <= 0)
    return table.refuse(row, "sigma_mm is {:g}, must be above 0", sigma)
        .of("sigma_mm")
        .beyond(sigma, 0);
  measurement.sigma = from_mm(sigma);
  return {};
}

/// Reads the measurement: a gauge, or a position.
Status read_measured(const CsvTable& table, std::size_t row, const BatchColumns& columns,
                     Measurement& measurement) {
  const bool gauged = says(table, row, columns.distance) || says(table, row, columns.touch);
  for (const auto& [column, name] : {std::pair(columns.minus_pose, "minus_pose_id"),
                                     std::pair(columns.from_pose, "from_pose_id")})
    if (!gauged && says(table, row, column))
      return table.refuse(row, "{} is told, but neither distance_mm nor touch_mm", name).of(name);
  if (gauged) {
    Gauge gauge = TRY(read_gauge(table, row, columns));
    measurement.gauge = std::move(gauge);
  }
  if (gauged || (columns.has_gauges() && !says(table, row, columns.position))) {
    measurement.p_W.setConstant(std::numeric_limits<double>::quiet_NaN());
  } else if (const Status position = read_position(table, row, columns, measurement); !position) {
    return position;
  }
  return read_sigma(table, row, columns, measurement);
}

Result<MeasurementSet> read_set(const CsvTable& table, std::size_t row,
                                const std::optional<std::size_t>& column) {
  const std::string name = column ? table.field(row, *column) : "";
  if (name.empty()) return MeasurementSet::kUnassigned;
  if (name == "train") return MeasurementSet::kTrain;
  if (name == "validation") return MeasurementSet::kValidation;
  return table.refuse(row, "set is '{}', expected train or validation", name)
      .of("set")
      .with_text(name);
}

Result<Measurement> read_measurement(const CsvTable& table, std::size_t row,
                                     const BatchColumns& columns) {
  Measurement measurement;
  PoseContext context = TRY(columns.pose.read(table, row));
  measurement.context = std::move(context);
  std::string pose_id = TRY(columns.pose.pose_id(table, row));
  measurement.pose_id = std::move(pose_id);
  measurement.row = table.line(row);
  TRY(read_measured(table, row, columns, measurement));
  const MeasurementSet set = TRY(read_set(table, row, columns.set));
  measurement.set = set;
  if (columns.session) measurement.session_id = table.field(row, *columns.session);
  for (const std::size_t column : columns.extra)
    measurement.extra.push_back(table.field(row, column));
  return measurement;
}

/// Refuses a distance of 0 to an anchor whose other distances are none: a wire that stands still or
/// broke reads 0 as well, and the tip did not meet the point.
Status check_zeros(const MeasurementBatch& batch) {
  std::set<std::string> measured;  // anchors with distances above 0
  for (const Measurement& m : batch.measurements)
    if (m.gauge && m.gauge->kind == Gauge::Kind::kDistance) measured.insert(m.gauge->anchor);
  for (const Measurement& m : batch.measurements) {
    if (!m.gauge || m.gauge->kind != Gauge::Kind::kContact || !measured.contains(m.gauge->anchor))
      continue;
    return refused("distance_mm is 0, and other rows have distances to the same anchor")
        .in(batch.where)
        .at_row(m.row)
        .of("distance_mm")
        .beyond(0, 0)
        .next(
            "leave the row out where the instrument read nothing; contacts of the tip with a point "
            "need an anchor_id of their own");
  }
  return {};
}

/// Links each gauge that is read against another pose to that pose, and removes the rows that hold
/// such a pose only. Refuses a missing pose, and a row without a value that no gauge refers to.
Status settle_gauges(MeasurementBatch& batch, const std::map<std::string, int>& line_of_pose) {
  std::map<std::string, std::shared_ptr<const PoseContext>> named;
  for (Measurement& m : batch.measurements) {
    if (!m.gauge || m.gauge->minus_pose.empty()) continue;
    const std::string& other = m.gauge->minus_pose;
    const auto fail = [&](Failure why) {
      const bool apart = m.gauge->kind == Gauge::Kind::kApart;
      return std::move(why)
          .in(batch.where)
          .at_row(m.row)
          .of(apart ? "from_pose_id" : "minus_pose_id");
    };
    if (!line_of_pose.contains(other))
      return fail(refused("no row has the pose_id '{}'", other).with_text(other));
    if (other == m.pose_id)
      return fail(refused("pose '{}' is told against itself", other).with_text(other));
    auto& context = named[other];
    if (context == nullptr) {
      const auto row = std::find_if(batch.measurements.begin(), batch.measurements.end(),
                                    [&](const Measurement& one) { return one.pose_id == other; });
      context = std::make_shared<const PoseContext>(row->context);
    }
    m.gauge->minus = context;
  }
  for (const Measurement& m : batch.measurements) {
    if (m.gauge || m.p_W.allFinite() || named.contains(m.pose_id)) continue;
    return refused("neither a position nor distance_mm nor touch_mm")
        .in(batch.where)
        .at_row(m.row)
        .of("distance_mm");
  }
  std::erase_if(batch.measurements,
                [](const Measurement& m) { return !m.gauge && !m.p_W.allFinite(); });
  return {};
}

/// The rows of a table whose columns have our names.
Result<MeasurementBatch> batch_of(const Result<CsvTable>& table, const std::string& text,
                                  const std::string& where) {
  if (!table) return tl::make_unexpected(table.error());
  const BatchColumns columns = TRY(find_columns(*table));
  if (table->size() == 0)
    return refused("no measurements below the header, at least 1 is needed").in(where).beyond(0, 1);
  MeasurementBatch batch;
  batch.id = std::filesystem::path(where).stem().string();
  batch.where = where;
  batch.joint_types = columns.pose.joint_types();
  batch.source_text = text;
  for (const std::size_t column : columns.extra)
    batch.extra_columns.push_back(table->columns()[column]);
  std::map<std::string, int> line_of_pose;
  for (std::size_t row = 0; row < table->size(); ++row) {
    Measurement measurement = TRY(read_measurement(*table, row, columns));
    const auto [earlier, is_new] = line_of_pose.emplace(measurement.pose_id, measurement.row);
    if (!is_new) {
      return table
          ->refuse(row, "pose_id '{}' is already that of row {}", measurement.pose_id,
                   earlier->second)
          .of("pose_id")
          .with_text(measurement.pose_id);
    }
    batch.measurements.push_back(std::move(measurement));
  }
  if (columns.has_gauges()) {
    TRY(check_zeros(batch));
    TRY(settle_gauges(batch, line_of_pose));
  }
  return batch;
}

}  // namespace

Result<MeasurementBatch> parse_batch_csv(const std::string& text, const std::string& where) {
  return batch_of(CsvTable::parse(text, where, kMostMeasurements), text, where);
}

namespace {

/// A column of a table without a header: our name for it, and the factor for its numbers.
struct ToldColumn {
  std::string name;  ///< empty: passed over
  double scale = 1;
};

/// `q1_rad` is `q1_deg` in another unit, and `x_m` `x_mm`.
ToldColumn told_column(const std::string& name) {
  if (name == "skip" || name == "-" || name.empty()) return {};
  if (name.starts_with("rv") && name.ends_with("_rad")) return {name, 1};
  const auto in = [&](std::string_view unit) {
    return name.size() > unit.size() && name.ends_with(unit)
               ? name.substr(0, name.size() - unit.size())
               : "";
  };
  if (const std::string stem = in("_rad"); !stem.empty()) return {stem + "_deg", to_deg(1)};
  if (const std::string stem = in("_m"); !stem.empty()) return {stem + "_mm", to_mm(1)};
  return {name, 1};
}

/// The rows in our units and columns, without the skipped columns.
Result<std::vector<CsvTable::Row>> told_rows(const std::vector<CsvTable::Row>& rows,
                                             const std::vector<ToldColumn>& columns,
                                             const std::string& where) {
  std::vector<CsvTable::Row> all;
  for (const CsvTable::Row& row : rows) {
    if (row.fields.size() != columns.size())
      return refused("{} values, {} columns are told", row.fields.size(), columns.size())
          .in(where)
          .at_row(row.line)
          .beyond(row.fields.size(), columns.size());
    CsvTable::Row& kept = all.emplace_back(CsvTable::Row{row.line, {}});
    for (std::size_t k = 0; k < columns.size(); ++k) {
      if (columns[k].name.empty()) continue;
      std::string field = row.fields[k];
      if (columns[k].scale != 1 && !field.empty()) {
        const std::string pointed = with_decimal_point(field);
        if (!is_number(pointed))
          return refused("{} is '{}', which is not a number", columns[k].name, field)
              .in(where)
              .at_row(row.line)
              .of(columns[k].name)
              .with_text(field);
        field = fmt::format("{:.15g}", std::stod(pointed) * columns[k].scale);
      }
      kept.fields.push_back(std::move(field));
    }
  }
  return all;
}

}  // namespace

Result<MeasurementBatch> parse_batch_table(const std::string& text,
                                           const std::vector<std::string>& columns,
                                           const std::string& where) {
  const std::vector<TextLine> lines = TRY(text_lines(text, where));
  const std::vector<TextLine> first = first_lines(text, 1);
  const char separator = first.empty() ? ',' : separator_of(first.front().text);
  std::vector<CsvTable::Row> rows = TRY(data_rows(lines, separator, where));
  const auto is_word = [](const std::string& field) {
    return !is_number(with_decimal_point(field));
  };
  // Ignores a first line of names if the caller gives the columns.
  if (rows.size() > 1 &&
      std::all_of(rows.front().fields.begin(), rows.front().fields.end(), is_word))
    rows.erase(rows.begin());
  std::vector<ToldColumn> told;
  CsvTable::Row header{1, {}};
  for (const std::string& column : columns) {
    told.push_back(told_column(column));
    if (!told.back().name.empty()) header.fields.push_back(told.back().name);
  }
  const std::vector<CsvTable::Row> kept = TRY(told_rows(rows, told, where));
  return batch_of(CsvTable::from_rows(where, header, kept, separator), "", where)
      .map([](MeasurementBatch batch) {
        batch.source_text = to_csv(batch);
        return batch;
      });
}

Result<MeasurementBatch> read_batch_table(const std::string& path,
                                          const std::vector<std::string>& columns) {
  return read_text_file(path)
      .and_then([&](const std::string& text) { return parse_batch_table(text, columns, path); })
      .map([&](MeasurementBatch batch) { return dated(std::move(batch), written_at(path)); });
}

Result<MeasurementBatch> read_batch_csv(const std::string& path) {
  return read_text_file(path)
      .and_then([&](const std::string& text) { return parse_batch_csv(text, path); })
      .map([&](MeasurementBatch batch) { return dated(std::move(batch), written_at(path)); });
}

}  // namespace trammel
