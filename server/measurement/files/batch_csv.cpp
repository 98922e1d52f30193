#include <algorithm>
#include <filesystem>
#include <functional>
#include <map>

#include "server/base/text_file.h"
#include "server/base/units.h"
#include "server/measurement/files/csv_table.h"
#include "server/measurement/measurement.h"
#include "server/measurement/pose_columns.h"

namespace trammel {

namespace {

constexpr double kPositionLimitMm = 1e6;            // beyond the range of any tracker
constexpr double kSigmaLimitMm = 5;                 // no instrument is worse, and micrometres read as millimetres are
constexpr std::size_t kMostMeasurements = 100'000;  // of one file: five times what one training takes

const std::vector<std::string> kPositionColumns = {"x_mm", "y_mm", "z_mm"};
const std::vector<std::string> kQuaternionColumns = {"qw", "qx", "qy", "qz"};

/// The columns of one batch file.
struct BatchColumns {
  PoseColumns pose;
  std::vector<std::size_t> position, quaternion, extra;
  std::optional<std::size_t> sigma, set, session;
};

Result<BatchColumns> find_columns(const CsvTable& table) {
  Result<PoseColumns> pose = PoseColumns::find(table);
  if (!pose) return tl::make_unexpected(pose.error());
  if (const Status has_joints = pose->require_joints(table); !has_joints) {
    return tl::make_unexpected(has_joints.error());
  }
  BatchColumns columns{std::move(*pose),        {}, {}, {}, table.find("sigma_mm"), table.find("set"),
                       table.find("session_id")};
  for (const std::string& name : kPositionColumns) {
    const Result<std::size_t> column = table.require(name);
    if (!column) return tl::make_unexpected(column.error());
    columns.position.push_back(*column);
  }
  Result<std::vector<std::size_t>> quaternion = table.all_or_none(kQuaternionColumns);
  if (!quaternion) return tl::make_unexpected(quaternion.error());
  columns.quaternion = std::move(*quaternion);

  std::vector<bool> used(table.columns().size(), false);
  for (const std::size_t column : columns.pose.used()) used[column] = true;
  for (const std::size_t column : columns.position) used[column] = true;
  for (const std::size_t column : columns.quaternion) used[column] = true;
  for (const auto& column : {columns.sigma, columns.set, columns.session}) {
    if (column) used[*column] = true;
  }
  for (std::size_t column = 0; column < used.size(); ++column) {
    if (!used[column]) columns.extra.push_back(column);
  }
  return columns;
}

Status read_position(const CsvTable& table, std::size_t row, const BatchColumns& columns, Measurement& measurement) {
  for (std::size_t k = 0; k < 3; ++k) {
    const Result<double> value = table.number(row, columns.position[k], kPositionLimitMm);
    if (!value) return tl::make_unexpected(value.error());
    measurement.p_W(static_cast<Eigen::Index>(k)) = from_mm(*value);
  }
  const auto empty = [&](std::size_t column) { return table.field(row, column).empty(); };
  if (!std::all_of(columns.quaternion.begin(), columns.quaternion.end(), empty)) {
    const Result<Matrix3> R_WT = table.rotation(row, columns.quaternion);
    if (!R_WT) return tl::make_unexpected(R_WT.error());
    measurement.R_WT = *R_WT;
  }
  if (columns.sigma && !empty(*columns.sigma)) {
    const Result<double> sigma = table.number(row, *columns.sigma, kSigmaLimitMm);
    if (!sigma) return tl::make_unexpected(sigma.error());
    if (*sigma <= 0)
      return table.refuse(row, "sigma_mm is {:g}, must be above 0", *sigma).of("sigma_mm").beyond(*sigma, 0);
    measurement.sigma = from_mm(*sigma);
  }
  return {};
}

Result<MeasurementSet> read_set(const CsvTable& table, std::size_t row, const std::optional<std::size_t>& column) {
  const std::string name = column ? table.field(row, *column) : "";
  if (name.empty()) return MeasurementSet::kUnassigned;
  if (name == "train") return MeasurementSet::kTrain;
  if (name == "validation") return MeasurementSet::kValidation;
  return table.refuse(row, "set is '{}', expected train or validation", name).of("set").with_text(name);
}

Result<Measurement> read_measurement(const CsvTable& table, std::size_t row, const BatchColumns& columns) {
  Measurement measurement;
  Result<PoseContext> context = columns.pose.read(table, row);
  if (!context) return tl::make_unexpected(context.error());
  measurement.context = std::move(*context);
  Result<std::string> pose_id = columns.pose.pose_id(table, row);
  if (!pose_id) return tl::make_unexpected(pose_id.error());
  measurement.pose_id = std::move(*pose_id);
  measurement.row = table.line(row);
  if (const Status position = read_position(table, row, columns, measurement); !position) {
    return tl::make_unexpected(position.error());
  }
  const Result<MeasurementSet> set = read_set(table, row, columns.set);
  if (!set) return tl::make_unexpected(set.error());
  measurement.set = *set;
  if (columns.session) measurement.session_id = table.field(row, *columns.session);
  for (const std::size_t column : columns.extra) measurement.extra.push_back(table.field(row, column));
  return measurement;
}

}  // namespace

Result<MeasurementBatch> parse_batch_csv(const std::string& text, const std::string& where) {
  const Result<CsvTable> table = CsvTable::parse(text, where, kMostMeasurements);
  if (!table) return tl::make_unexpected(table.error());
  const Result<BatchColumns> columns = find_columns(*table);
  if (!columns) return tl::make_unexpected(columns.error());
  if (table->size() == 0)
    return refused("no measurements below the header, at least 1 is needed").in(where).beyond(0, 1);
  MeasurementBatch batch;
  batch.id = std::filesystem::path(where).stem().string();
  batch.where = where;
  batch.joint_types = columns->pose.joint_types();
  batch.source_text = text;
  for (const std::size_t column : columns->extra) batch.extra_columns.push_back(table->columns()[column]);
  std::map<std::string, int> line_of_pose;
  for (std::size_t row = 0; row < table->size(); ++row) {
    Result<Measurement> measurement = read_measurement(*table, row, *columns);
    if (!measurement) return tl::make_unexpected(measurement.error());
    const auto [earlier, is_new] = line_of_pose.emplace(measurement->pose_id, measurement->row);
    if (!is_new) {
      return table->refuse(row, "pose_id '{}' is already that of row {}", measurement->pose_id, earlier->second)
          .of("pose_id")
          .with_text(measurement->pose_id);
    }
    batch.measurements.push_back(std::move(*measurement));
  }
  return batch;
}

Result<MeasurementBatch> read_batch_csv(const std::string& path) {
  return read_text_file(path)
      .and_then([&](const std::string& text) { return parse_batch_csv(text, path); })
      .map([&](MeasurementBatch batch) { return dated(std::move(batch), written_at(path)); });
}

namespace {

/// One column of a written batch: its name and its field for a measurement.
struct WrittenColumn {
  std::string name;
  std::function<std::string(const Measurement&)> field;
};

std::string optional_field(const std::optional<double>& value, double scale = 1) {
  return value ? csv_number(*value * scale) : "";
}

void add_pose_columns(const MeasurementBatch& batch, std::vector<WrittenColumn>& columns) {
  columns.push_back({"pose_id", [](const Measurement& m) { return csv_field(m.pose_id); }});
  const Eigen::Index joints = batch.measurements.empty() ? 0 : batch.measurements.front().context.q.size();
  for (Eigen::Index j = 0; j < joints; ++j) {
    const auto at = static_cast<std::size_t>(j);
    const JointType type = at < batch.joint_types.size() ? batch.joint_types[at] : JointType::kRevolute;
    columns.push_back({joint_column(static_cast<int>(j), type),
                       [j, type](const Measurement& m) { return csv_number(joint_to_column(m.context.q(j), type)); }});
  }
  for (int k = 0; k < 3; ++k) {
    columns.push_back({kPositionColumns[static_cast<std::size_t>(k)],
                       [k](const Measurement& m) { return csv_number(to_mm(m.p_W(k))); }});
  }
  for (int k = 0; k < 4; ++k) {
    columns.push_back({kQuaternionColumns[static_cast<std::size_t>(k)], [k](const Measurement& m) -> std::string {
                         if (!m.R_WT) return "";
                         const Eigen::Quaterniond R(*m.R_WT);
                         return csv_number(k == 0 ? R.w() : R.vec()(k - 1));
                       }});
  }
}

void add_circumstance_columns(const MeasurementBatch& batch, std::vector<WrittenColumn>& columns) {
  columns.push_back({"sigma_mm", [](const Measurement& m) { return optional_field(m.sigma, to_mm(1)); }});
  columns.push_back(
      {"time_s", [](const Measurement& m) { return m.context.time ? fmt::format("{:.15g}", *m.context.time) : ""; }});
  columns.push_back({"temperature_c", [](const Measurement& m) { return optional_field(m.context.temperature); }});
  columns.push_back({"tool_id", [](const Measurement& m) { return csv_field(m.context.tool); }});
  columns.push_back({"payload_id", [](const Measurement& m) { return csv_field(m.context.payload); }});
  std::size_t directions = 0;
  for (const Measurement& m : batch.measurements) directions = std::max(directions, m.context.direction.size());
  for (std::size_t j = 0; j < directions; ++j) {
    columns.push_back({fmt::format("dir{}", j + 1), [j](const Measurement& m) {
                         return j < m.context.direction.size() ? fmt::format("{}", m.context.direction[j]) : "";
                       }});
  }
  columns.push_back({"session_id", [](const Measurement& m) { return csv_field(m.session_id); }});
  columns.push_back(
      {"set", [](const Measurement& m) {
         return m.set == MeasurementSet::kUnassigned ? "" : m.set == MeasurementSet::kTrain ? "train" : "validation";
       }});
  for (std::size_t k = 0; k < batch.extra_columns.size(); ++k) {
    columns.push_back({batch.extra_columns[k],
                       [k](const Measurement& m) { return k < m.extra.size() ? csv_field(m.extra[k]) : ""; }});
  }
}

}  // namespace

std::string to_csv(const MeasurementBatch& batch) {
  std::vector<WrittenColumn> columns;
  add_pose_columns(batch, columns);
  add_circumstance_columns(batch, columns);
  std::erase_if(columns, [&](const WrittenColumn& column) {
    return std::all_of(batch.measurements.begin(), batch.measurements.end(),
                       [&](const Measurement& m) { return column.field(m).empty(); });
  });
  std::string text;
  for (const WrittenColumn& column : columns) {
    if (!text.empty()) text += ',';
    text += csv_field(column.name);
  }
  text += '\n';
  for (const Measurement& measurement : batch.measurements) {
    for (std::size_t k = 0; k < columns.size(); ++k) {
      if (k > 0) text += ',';
      text += columns[k].field(measurement);
    }
    text += '\n';
  }
  return text;
}

}  // namespace trammel
