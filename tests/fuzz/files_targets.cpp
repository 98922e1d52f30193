// Files: models, batches of every maker, lists of joints and points, robots, cells.
#include <memory>

#include "clients/cli/files/target_file.h"
#include "server/base/check.h"
#include "server/base/text_file.h"
#include "server/calibrate/instruments/arc_list.h"
#include "server/calibrate/instruments/deflection_list.h"
#include "server/compensate/model_file.h"
#include "server/compensate/model_spec.h"
#include "server/measurement/checked_batch.h"
#include "server/measurement/files/batch_file.h"
#include "server/measurement/files/joint_list.h"
#include "server/measurement/files/point_list.h"
#include "server/robot/cell_sources_file.h"
#include "tests/fuzz/target.h"

namespace trammel::fuzz {
namespace {

const std::string& robot_yaml() {
  static const std::string text =
      read_text_file(TRAMMEL_SOURCE_DIR "/models/abb_irb6640-205-275.yaml").value();
  return text;
}

std::string cell_yaml(const char* bias) {
  return fmt::format(
      "version: 1\ncell: cell-7\nrobot: robot.yaml\nbase: {{xyz_mm: [0, 0, 0], q_wxyz: [1, 0, 0, "
      "0]}}\n"
      "tools: {{spindle: {{xyz_mm: [58.553, -193.735, 165.958], q_wxyz: [1, 0, 0, 0]}}, probe: "
      "null}}\n"
      "payloads: {{load: {{mass_kg: 94.5, cog_mm: [-68.5, 5.0, 208.5]}}}}\ntracker: {{sigma_mm: "
      "0.02}}\n"
      "model: {{error_sources: [base], bias: {}}}\n",
      bias);
}

const std::shared_ptr<const Cell>& cell() {
  static const auto one =
      std::make_shared<const Cell>(parse_cell(cell_yaml("se"), robot_yaml(), "cell.yaml").value());
  return one;
}

template <typename T>
std::string words(const Result<T>& result) {
  return result ? "taken" : words_of(result.error());
}

/// A model that is taken predicts numbers, and its own text is taken.
std::string read_model(std::string_view bytes) {
  const Result<CompensatedModel> model = deserialize(std::string(bytes), "fuzzed.model");
  if (!model) return words_of(model.error());
  const Result<CompensatedModel> again = deserialize(serialize(*model), "again.model");
  TRAMMEL_CHECK(again.has_value());
  return "taken";
}

/// A batch that is taken is taken again as it is written.
std::string finish(const Result<MeasurementBatch>& batch) {
  if (!batch) return words_of(batch.error());
  const Result<MeasurementBatch> again = parse_batch_csv(to_csv(*batch), "again.csv");
  TRAMMEL_CHECK(again.has_value() && again->measurements.size() == batch->measurements.size());
  return "taken, " + words(check_against_cell(*batch, *cell(), drawn(0.2, 1)));
}

std::string read_any_batch(std::string_view bytes) {
  return finish(parse_batch(std::string(bytes), "fuzzed.csv"));
}
std::string read_batch_table(std::string_view bytes) {
  return finish(parse_batch_csv(std::string(bytes), "fuzzed.csv"));
}
std::string read_robodk(std::string_view bytes) {
  return finish(parse_robodk_csv(std::string(bytes), "fuzzed.csv"));
}
std::string read_joints(std::string_view bytes) {
  const Result<JointList> list = parse_joint_csv(std::string(bytes), "fuzzed.csv");
  if (!list) return words_of(list.error());
  return "taken, " + words(check_against_cell(*list, *cell()));
}
std::string read_targets(std::string_view bytes) {
  const Result<cli::TargetFile> file = cli::parse_targets_csv(std::string(bytes), "fuzzed.csv");
  if (!file) return words_of(file.error());
  return "taken, " + words(check_targets(*file, cell()->robot));
}
std::string read_points_file(std::string_view bytes) {
  return words(parse_points(std::string(bytes), "fuzzed.txt"));
}
std::string read_arcs(std::string_view bytes) {
  return words(parse_arcs_csv(std::string(bytes), "fuzzed.csv", cell()->robot));
}
std::string read_deflections(std::string_view bytes) {
  return words(parse_deflection_csv(std::string(bytes), "fuzzed.csv"));
}
std::string read_robot_file(std::string_view bytes) {
  const Result<Chain> robot = parse_robot(std::string(bytes), "fuzzed.yaml");
  if (!robot) return words_of(robot.error());
  static_cast<void>(robot->flange_pose(JointVector::Zero(robot->size())));
  return "taken";
}

/// A cell that is taken says what a training would refuse, and its list of error sources can be
/// asked to change.
std::string read_cell_file(std::string_view bytes) {
  const std::string text(bytes);
  const Result<Cell> read = parse_cell(text, robot_yaml(), "fuzzed.yaml");
  if (!read) return words_of(read.error());
  std::string said = "taken";
  for (const Error& why : check_model_spec(*read, "fuzzed.yaml")) said += ", " + words_of(why);
  return said + ", " + words(with_error_sources(text, {"base", "geometry"}, "fuzzed.yaml"));
}

std::vector<std::string> shipped_robot() { return {robot_yaml()}; }
std::vector<std::string> small_cells() { return {cell_yaml("none"), cell_yaml("se + joint_map")}; }

}  // namespace

const std::vector<Target>& targets() {
  static const std::vector<Target> all = {
      {"model", read_model, mutate_model},
      {"batch", read_any_batch, mutate_table},
      {"batch_csv", read_batch_table, mutate_table},
      {"robodk_csv", read_robodk, mutate_table},
      {"joint_list", read_joints, mutate_table},
      {"targets", read_targets, mutate_table},
      {"point_list", read_points_file, mutate_table},
      {"arc_list", read_arcs, mutate_table},
      {"deflection_list", read_deflections, mutate_table},
      {"robot_yaml", read_robot_file, mutate_yaml, shipped_robot},
      {"cell_yaml", read_cell_file, mutate_yaml, small_cells},
  };
  return all;
}

}  // namespace trammel::fuzz
