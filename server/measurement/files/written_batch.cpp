#include <algorithm>
#include <functional>
#include <map>
#include <memory>

#include "server/base/units.h"
#include "server/measurement/files/batch_columns.h"
#include "server/measurement/files/csv_table.h"
#include "server/measurement/measurement.h"
#include "server/measurement/pose_columns.h"

namespace trammel {

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
  const Eigen::Index joints =
      batch.measurements.empty() ? 0 : batch.measurements.front().context.q.size();
  for (Eigen::Index j = 0; j < joints; ++j) {
    const auto at = static_cast<std::size_t>(j);
    const JointType type =
        at < batch.joint_types.size() ? batch.joint_types[at] : JointType::kRevolute;
    columns.push_back({joint_column(static_cast<int>(j), type), [j, type](const Measurement& m) {
                         return csv_number(joint_to_column(m.context.q(j), type));
                       }});
  }
  for (int k = 0; k < 3; ++k) {
    columns.push_back({kPositionColumns[static_cast<std::size_t>(k)], [k](const Measurement& m) {
                         return m.p_W.allFinite() && !m.gauge ? csv_number(to_mm(m.p_W(k))) : "";
                       }});
  }
  for (int k = 0; k < 4; ++k) {
    columns.push_back(
        {kQuaternionColumns[static_cast<std::size_t>(k)], [k](const Measurement& m) -> std::string {
           if (!m.R_WT) return "";
           const Eigen::Quaterniond R(*m.R_WT);
           return csv_number(k == 0 ? R.w() : R.vec()(k - 1));
         }});
  }
}

void add_gauge_columns(std::vector<WrittenColumn>& columns) {
  const auto add = [&](const char* name, bool touches) {
    columns.push_back({name, [touches](const Measurement& m) {
                         return m.gauge && (m.gauge->kind == Gauge::Kind::kTouch) == touches
                                    ? csv_number(to_mm(m.gauge->value))
                                    : "";
                       }});
  };
  add("distance_mm", false);
  add("touch_mm", true);
  columns.push_back({"anchor_id", [](const Measurement& m) {
                       return m.gauge ? csv_field(m.gauge->anchor) : "";
                     }});
  const auto add_other = [&](const char* name, bool apart) {
    columns.push_back({name, [apart](const Measurement& m) {
                         return m.gauge && (m.gauge->kind == Gauge::Kind::kApart) == apart
                                    ? csv_field(m.gauge->minus_pose)
                                    : "";
                       }});
  };
  add_other("minus_pose_id", false);
  add_other("from_pose_id", true);
}

void add_circumstance_columns(const MeasurementBatch& batch, std::vector<WrittenColumn>& columns) {
  columns.push_back(
      {"sigma_mm", [](const Measurement& m) { return optional_field(m.sigma, to_mm(1)); }});
  columns.push_back({"time_s", [](const Measurement& m) {
                       return m.context.time ? fmt::format("{:.15g}", *m.context.time) : "";
                     }});
  columns.push_back({"temperature_c",
                     [](const Measurement& m) { return optional_field(m.context.temperature); }});
  columns.push_back({"tool_id", [](const Measurement& m) { return csv_field(m.context.tool); }});
  columns.push_back(
      {"payload_id", [](const Measurement& m) { return csv_field(m.context.payload); }});
  std::size_t directions = 0;
  for (const Measurement& m : batch.measurements)
    directions = std::max(directions, m.context.direction.size());
  for (std::size_t j = 0; j < directions; ++j) {
    columns.push_back({fmt::format("dir{}", j + 1), [j](const Measurement& m) {
                         return j < m.context.direction.size()
                                    ? fmt::format("{}", m.context.direction[j])
                                    : "";
                       }});
  }
  columns.push_back({"session_id", [](const Measurement& m) { return csv_field(m.session_id); }});
  columns.push_back({"set", [](const Measurement& m) {
                       return m.set == MeasurementSet::kUnassigned ? ""
                              : m.set == MeasurementSet::kTrain    ? "train"
                                                                   : "validation";
                     }});
  for (std::size_t k = 0; k < batch.extra_columns.size(); ++k) {
    columns.push_back({batch.extra_columns[k], [k](const Measurement& m) {
                         return k < m.extra.size() ? csv_field(m.extra[k]) : "";
                       }});
  }
}

}  // namespace

namespace {

/// The batch plus the poses to which gauges refer and which are no measurements themselves.
MeasurementBatch with_named_poses(MeasurementBatch batch) {
  std::map<std::string, const PoseContext*> missing;
  for (const Measurement& m : batch.measurements) {
    if (m.gauge && m.gauge->minus != nullptr) missing[m.gauge->minus_pose] = m.gauge->minus.get();
  }
  for (const Measurement& m : batch.measurements) missing.erase(m.pose_id);
  std::vector<Measurement> named;
  for (const auto& [id, context] : missing) {
    Measurement& one = named.emplace_back();
    one.pose_id = id;
    one.context = *context;
    one.p_W.setConstant(std::numeric_limits<double>::quiet_NaN());
  }
  batch.measurements.insert(batch.measurements.begin(), named.begin(), named.end());
  return batch;
}

}  // namespace

std::string to_csv(const MeasurementBatch& given) {
  const MeasurementBatch batch = with_named_poses(given);
  std::vector<WrittenColumn> columns;
  add_pose_columns(batch, columns);
  add_gauge_columns(columns);
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
