#include "clients/cli/service/answers.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <map>
#include <set>
#include <string_view>

#include "server/base/letters.h"
#include "server/exchange/columns.h"
#include "server/measurement/files/csv_table.h"
#include "server/measurement/pose_columns.h"
#include "server/report/answer_json.h"
#include "server/report/note_json.h"

namespace trammel::cli {

namespace {

using nlohmann::ordered_json;

using exchange::each_column;
using exchange::each_column_at;
using exchange::kPoseColumns;

std::string pose_fields(const exchange::Pose& pose) {
  std::string fields;
  each_column(kPoseColumns, pose, [&](const std::string&, double number) {
    fields += (fields.empty() ? "" : ",") + csv_number(number);
  });
  return fields;
}

JointType type_of(const std::vector<JointType>& types, std::size_t joint) {
  return joint < types.size() ? types[joint] : JointType::kRevolute;
}

std::size_t joint_count(const Corrections& corrections) {
  std::size_t joints = corrections.joint_types.size();
  for (const exchange::CorrectedTarget& item : corrections.items)
    joints = std::max(joints, item.joints_deg.size());
  return joints;
}

}  // namespace

std::string predictions_csv(const JointList& list, const Predictions& predictions) {
  std::vector<exchange::Place> behind = {exchange::Place::kBehind};
  if (predictions.covariance) behind.push_back(exchange::Place::kCovariance);
  if (predictions.orientation) behind.push_back(exchange::Place::kOrientation);
  const auto line = [&](const exchange::Prediction& item, const std::string& names,
                        const auto& in_front, const auto& after) {
    std::string text;
    each_column_at(
        exchange::Place::kInFront, exchange::kPredictionFigures, item,
        [&](const std::string& name, double number) { text += in_front(name, number) + ","; });
    text += names;
    for (const exchange::Place place : behind) {
      each_column_at(
          place, exchange::kPredictionFigures, item,
          [&](const std::string& name, double number) { text += "," + after(name, number); });
    }
    return text + "\n";
  };
  const auto name_of = [](const std::string& name, double) { return name; };
  const auto number_of = [](const std::string&, double number) { return csv_number(number); };
  const auto short_number_of = [](const std::string&, double number) {
    return fmt::format("{:.9g}", number);
  };
  std::string text = line({}, "pose_id,model_id", name_of, name_of);
  for (std::size_t i = 0; i < predictions.items.size(); ++i) {
    const std::string names = csv_field(list.poses[i].pose_id) + "," + predictions.model_id;
    text += line(predictions.items[i], names, number_of, short_number_of);
  }
  return text;
}

ordered_json predictions_json(const JointList& list, const Predictions& predictions) {
  ordered_json items = ordered_json::array();
  for (std::size_t i = 0; i < predictions.items.size(); ++i) {
    ordered_json item = {{"pose_id", list.poses[i].pose_id}};
    put_figures(predictions.items[i], {predictions.covariance, predictions.orientation}, item);
    items.push_back(std::move(item));
  }
  return {{"model", predictions.model_id},
          {"notes", notes_json(predictions.notes)},
          {"predictions", items}};
}

namespace {

/// The columns of corrections_csv() without those of the target file.
std::vector<std::string> correction_columns(const Corrections& corrections) {
  std::vector<std::string> columns = {"row", "status"};
  const auto add = [&](const std::string& name, double) { columns.push_back(name); };
  each_column(kPoseColumns, exchange::Pose(), add);
  const std::size_t joints = joint_count(corrections);
  for (std::size_t j = 0; j < joints; ++j) {
    columns.push_back(joint_column(static_cast<int>(j), type_of(corrections.joint_types, j)));
  }
  const exchange::CorrectedTarget any;
  each_column_at(exchange::Place::kInFront, exchange::kCorrectionFigures, any, add);
  columns.insert(columns.end(), {"model_id", "message"});
  each_column_at(exchange::Place::kBehind, exchange::kCorrectionFigures, any, add);
  if (!corrections.turned_deg.empty()) columns.emplace_back("turned_rz_deg");
  return columns;
}

/// The names of the file's columns when the columns `ours` follow them. No name occurs twice,
/// whatever the case.
std::vector<std::string> kept_columns(const std::vector<std::string>& columns,
                                      const std::vector<std::string>& ours) {
  std::set<std::string> taken;
  for (const std::string& name : ours) taken.insert(lower(name));
  std::vector<std::string> kept = columns;
  std::vector<std::size_t> clashing;
  for (std::size_t k = 0; k < kept.size(); ++k) {
    if (taken.contains(lower(kept[k]))) clashing.push_back(k);
  }
  for (const std::string& name : kept) taken.insert(lower(name));
  for (const std::size_t k : clashing) {
    while (taken.contains(lower(kept[k]))) kept[k] = "input_" + kept[k];
    taken.insert(lower(kept[k]));
  }
  return kept;
}

/// Empty where there is nothing to say.
std::string field_of(double value) { return std::isfinite(value) ? csv_number(value) : ""; }

}  // namespace

std::size_t Corrections::lead_in_points() const {
  std::size_t points = 0;
  for (const auto& of_target : lead_ins) points += of_target.size();
  return points;
}

namespace {

void add_row(const Corrections& corrections, std::size_t joints, const TargetRow& row,
             const exchange::CorrectedTarget& item, std::string& text) {
  const bool command = has_command(item);
  for (const std::string& field : row.fields) text += csv_field(field) + ",";
  text += fmt::format("{},{},{}", row.row, item.status,
                      command ? pose_fields(item.commanded) : ",,,,,,");
  for (std::size_t j = 0; j < joints; ++j) {
    text += ',';
    if (command && j < item.joints_deg.size()) text += csv_number(item.joints_deg[j]);
  }
  const auto add = [&](const std::string&, double number) { text += "," + field_of(number); };
  each_column_at(exchange::Place::kInFront, exchange::kCorrectionFigures, item, add);
  text += fmt::format(",{},{}", corrections.model_id, csv_field(item.message));
  each_column_at(exchange::Place::kBehind, exchange::kCorrectionFigures, item, add);
}

}  // namespace

std::string corrections_csv(const TargetFile& file, const Corrections& corrections) {
  const std::vector<std::string> ours = correction_columns(corrections);
  std::string text;
  for (const std::string& name : kept_columns(file.columns, ours)) text += csv_field(name) + ",";
  text += fmt::format("{}\n", fmt::join(ours, ","));
  const std::size_t joints = joint_count(corrections);
  for (std::size_t i = 0; i < corrections.items.size(); ++i) {
    const std::string end = corrections.turned_deg.empty()
                                ? "\n"
                                : fmt::format(",{}\n", csv_number(corrections.turned_deg[i]));
    if (i < corrections.lead_ins.size()) {
      for (const exchange::CorrectedTarget& point : corrections.lead_ins[i]) {
        add_row(corrections, joints, file.rows[i], point, text);
        text += end;
      }
    }
    add_row(corrections, joints, file.rows[i], corrections.items[i], text);
    text += end;
  }
  return text;
}

ordered_json corrections_json(const TargetFile& file, const Corrections& corrections) {
  ordered_json items = ordered_json::array();
  for (std::size_t i = 0; i < corrections.items.size(); ++i) {
    const exchange::CorrectedTarget& item = corrections.items[i];
    ordered_json json = {
        {"row", file.rows[i].row}, {"status", item.status}, {"message", item.message}};
    json["input"] = ordered_json::object();
    for (std::size_t k = 0; k < file.rows[i].fields.size(); ++k) {
      json["input"][file.columns[k]] = file.rows[i].fields[k];
    }
    put_command(item, corrections.joint_types, json);
    if (!corrections.turned_deg.empty()) json["turned_rz_deg"] = corrections.turned_deg[i];
    if (!corrections.lead_ins.empty()) {
      json["lead_in"] = ordered_json::array();
      for (const exchange::CorrectedTarget& point : corrections.lead_ins[i])
        put_command(point, corrections.joint_types,
                    json["lead_in"].emplace_back(ordered_json::object()));
    }
    put_figures(item, json);
    items.push_back(json);
  }
  ordered_json all = {{"model", corrections.model_id}};
  if (!corrections.lead_ins.empty()) all["lead_ins"] = corrections.lead_in_points();
  all["targets"] = items;
  return all;
}

std::string corrections_summary(const Corrections& corrections) {
  std::map<std::string, int> counts;
  for (const exchange::CorrectedTarget& item : corrections.items) ++counts[item.status];
  std::string text = fmt::format("{} targets:", corrections.items.size());
  const char* separator = " ";
  for (const auto& [status, count] : counts) {
    text += fmt::format("{}{} {}", separator, count, status);
    separator = ", ";
  }
  if (!corrections.lead_ins.empty())
    text += fmt::format("; {} points of lead-ins", corrections.lead_in_points());
  if (!corrections.turned_deg.empty()) {
    const auto turned = std::count_if(corrections.turned_deg.begin(), corrections.turned_deg.end(),
                                      [](double turn) { return turn != 0; });
    text += fmt::format("; {} turned about the tool's axis", turned);
  }
  return text + "\n";
}

std::string left_alone_text(const TargetFile& file, const Corrections& corrections) {
  constexpr std::size_t kLines = 10;
  std::string lines;
  std::size_t left = 0;
  for (std::size_t i = 0; i < corrections.items.size(); ++i) {
    const exchange::CorrectedTarget& item = corrections.items[i];
    if (has_command(item) || ++left > kLines) continue;
    lines += fmt::format("  {} row {}: {}: {}\n", file.where, file.rows[i].row, item.status,
                         item.message);
  }
  if (left == 0) return "";
  if (left > kLines) lines += fmt::format("  and {} more\n", left - kLines);
  return fmt::format("{} of {} targets are left as they were:\n{}", left, corrections.items.size(),
                     lines);
}

}  // namespace trammel::cli
