#include "server/measurement/pose_columns.h"

#include <algorithm>
#include <charconv>
#include <map>
#include <string_view>

#include "server/base/letters.h"
#include "server/base/units.h"

namespace trammel {

namespace {

constexpr double kTimeLimit = 1e12;        // s
constexpr double kTemperatureLimit = 1e3;  // degrees Celsius

struct JointColumn {
  int number = 0;  // from 1
  JointType type = JointType::kRevolute;
};

/// `q12_deg`, `Q12_DEG` -> 12, revolute; nothing for any other name.
std::optional<JointColumn> as_joint_column(std::string_view column_name) {
  const std::string name = lower(column_name);
  if (!name.starts_with('q')) return std::nullopt;
  JointColumn column;
  const auto [end, error] =
      std::from_chars(name.data() + 1, name.data() + name.size(), column.number);
  const std::string_view unit(end, static_cast<std::size_t>(name.data() + name.size() - end));
  if (error != std::errc() || column.number < 0 || (unit != "_deg" && unit != "_mm"))
    return std::nullopt;
  column.type = unit == "_deg" ? JointType::kRevolute : JointType::kPrismatic;
  return column;
}

/// The number of an optional column in this row; an empty field means that nothing was recorded.
Result<std::optional<double>> optional_number(const CsvTable& table, std::size_t row,
                                              const std::optional<std::size_t>& column,
                                              double limit) {
  if (!column || table.field(row, *column).empty()) return std::optional<double>();
  return table.number(row, *column, limit).map([](double value) { return std::optional(value); });
}

}  // namespace

Result<PoseColumns> PoseColumns::find(const CsvTable& table) {
  PoseColumns found;
  std::map<int, std::pair<std::size_t, JointType>> joints;
  for (std::size_t i = 0; i < table.columns().size(); ++i) {
    const auto joint = as_joint_column(table.columns()[i]);
    if (joint && joint->number == 0)
      return refused("column {}: joints count from 1", table.columns()[i])
          .in(table.where())
          .of(table.columns()[i])
          .next("name the columns q1_deg, q2_deg and so on");
    if (joint && !joints.emplace(joint->number, std::pair(i, joint->type)).second) {
      return refused("two columns for joint {}: {} and {}", joint->number,
                     table.columns()[joints[joint->number].first], table.columns()[i])
          .in(table.where())
          .of(table.columns()[i]);
    }
  }
  std::vector<std::string> direction_names;
  for (const auto& [number, column] : joints) {
    if (number != static_cast<int>(found.joints_.size()) + 1) {
      return tl::make_unexpected(
          table.require(fmt::format("q{}_deg", found.joints_.size() + 1)).error());
    }
    found.joints_.push_back(column.first);
    found.joint_types_.push_back(column.second);
    direction_names.push_back(fmt::format("dir{}", number));
  }
  // Targets on a branch have no joints of their own, but they may have an approach.
  for (int n = 1; joints.empty() && table.find(fmt::format("dir{}", n)); ++n)
    direction_names.push_back(fmt::format("dir{}", n));
  std::vector<std::size_t> directions = TRY(table.all_or_none(direction_names));
  found.directions_ = std::move(directions);
  found.time_ = table.find("time_s");
  found.temperature_ = table.find("temperature_c");
  found.tool_ = table.find("tool_id");
  found.payload_ = table.find("payload_id");
  found.pose_id_ = table.find("pose_id");
  return found;
}

Status PoseColumns::require_joints(const CsvTable& table) const {
  if (!joints_.empty()) return {};
  return tl::make_unexpected(table.require("q1_deg").error());
}

Result<JointVector> PoseColumns::joints(const CsvTable& table, std::size_t row) const {
  JointVector q(static_cast<Eigen::Index>(joints_.size()));
  for (std::size_t j = 0; j < joints_.size(); ++j) {
    const double value = TRY(table.number(row, joints_[j]));
    q(static_cast<Eigen::Index>(j)) =
        joint_types_[j] == JointType::kRevolute ? from_deg(value) : from_mm(value);
  }
  return q;
}

bool PoseColumns::joints_empty(const CsvTable& table, std::size_t row) const {
  return std::all_of(joints_.begin(), joints_.end(),
                     [&](std::size_t column) { return table.field(row, column).empty(); });
}

Result<PoseContext> PoseColumns::circumstances(const CsvTable& table, std::size_t row) const {
  PoseContext context;
  const auto time = TRY(optional_number(table, row, time_, kTimeLimit));
  const auto temperature = TRY(optional_number(table, row, temperature_, kTemperatureLimit));
  context.time = time;
  context.temperature = temperature;
  for (const std::size_t column : directions_) {
    const int direction =
        TRY(table.field(row, column).empty() ? 0 : table.integer(row, column, -1, 1));
    context.direction.push_back(direction);
  }
  context.index = static_cast<int>(row);
  for (const auto& [column, text] :
       {std::pair(tool_, &context.tool), std::pair(payload_, &context.payload)}) {
    if (!column) continue;
    std::string name = TRY(table.name(row, *column));
    *text = std::move(name);
  }
  return context;
}

Result<PoseContext> PoseColumns::read(const CsvTable& table, std::size_t row) const {
  JointVector q = TRY(joints(table, row));
  return circumstances(table, row).map([&](PoseContext context) {
    context.q = std::move(q);
    return context;
  });
}

Result<std::string> PoseColumns::pose_id(const CsvTable& table, std::size_t row) const {
  if (pose_id_ && !table.field(row, *pose_id_).empty()) return table.name(row, *pose_id_);
  return fmt::format("{}", row + 1);
}

std::vector<std::size_t> PoseColumns::used() const {
  std::vector<std::size_t> used = joints_;
  used.insert(used.end(), directions_.begin(), directions_.end());
  for (const auto& column : {time_, temperature_, tool_, payload_, pose_id_}) {
    if (column) used.push_back(*column);
  }
  return used;
}

std::string joint_column(int joint, JointType type) {
  return fmt::format("q{}_{}", joint + 1, type == JointType::kRevolute ? "deg" : "mm");
}

std::vector<JointType> joint_types(const Chain& robot) {
  std::vector<JointType> types;
  for (int j = 0; j < robot.size(); ++j) types.push_back(robot.joint(j).type);
  return types;
}

double joint_to_column(double value, JointType type) {
  return type == JointType::kRevolute ? to_deg(value) : to_mm(value);
}

std::string joint_text(double value, JointType type) {
  return fmt::format("{:.6g} {}", joint_to_column(value, type),
                     type == JointType::kRevolute ? "deg" : "mm");
}

}  // namespace trammel
