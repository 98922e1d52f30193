#pragma once

#include <optional>
#include <string>
#include <vector>

#include "server/base/result.h"
#include "server/measurement/files/csv_table.h"
#include "server/robot/chain.h"
#include "server/robot/pose_context.h"

namespace trammel {

/// The columns of a table that describe commanded poses: `q1_deg` (of a rail `q1_mm`) and on,
/// `dir1` and on, `time_s`, `temperature_c`, `tool_id`, `payload_id`, `pose_id`. Shared by batches,
/// joint lists and targets.
class PoseColumns {
 public:
  /// Refuses a gap in the joint columns or directions that do not match them. No joint column at
  /// all is refused by require_joints() only.
  [[nodiscard]] static Result<PoseColumns> find(const CsvTable& table);
  [[nodiscard]] Status require_joints(const CsvTable& table) const;

  [[nodiscard]] const std::vector<JointType>& joint_types() const { return joint_types_; }
  /// Commanded joints, rad (m).
  [[nodiscard]] Result<JointVector> joints(const CsvTable& table, std::size_t row) const;
  /// True when every joint field of the row is empty.
  [[nodiscard]] bool joints_empty(const CsvTable& table, std::size_t row) const;
  /// Everything about the pose but its joints.
  [[nodiscard]] Result<PoseContext> circumstances(const CsvTable& table, std::size_t row) const;
  [[nodiscard]] Result<PoseContext> read(const CsvTable& table, std::size_t row) const;
  /// The pose_id column, else the row's count from 1. Refuses an id that is no name.
  [[nodiscard]] Result<std::string> pose_id(const CsvTable& table, std::size_t row) const;
  /// All columns that this class reads.
  [[nodiscard]] std::vector<std::size_t> used() const;

 private:
  std::vector<JointType> joint_types_;
  std::vector<std::size_t> joints_, directions_;
  std::optional<std::size_t> time_, temperature_, tool_, payload_, pose_id_;
};

/// `q3_deg`, or `q3_mm` of a prismatic joint; `joint` counts from 0.
[[nodiscard]] std::string joint_column(int joint, JointType type);
/// The types of all joints of a robot.
[[nodiscard]] std::vector<JointType> joint_types(const Chain& robot);
/// A joint value as its column holds it.
[[nodiscard]] double joint_to_column(double value, JointType type);
/// The joint value and its unit for messages: `241.2 deg`.
[[nodiscard]] std::string joint_text(double value, JointType type);

}  // namespace trammel
