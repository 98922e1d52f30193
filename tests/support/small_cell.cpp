#include "tests/support/small_cell.h"

#include <random>

#include "server/base/units.h"
#include "tests/support/demand.h"
#include "tests/support/temporary_folder.h"

namespace trammel::test {

std::string small_robot_yaml() {
  return read_file(TRAMMEL_SOURCE_DIR "/models/abb_irb6640-205-275.yaml");
}

std::string small_cell_yaml(const std::string& name, const std::string& bias) {
  return fmt::format(
      "version: 1\n"
      "cell: {}\n"
      "robot: robot.yaml\n"
      "base: {{xyz_mm: [0, 0, 0], q_wxyz: [1, 0, 0, 0]}}\n"
      "tools: {{spindle: {{xyz_mm: [58.553, -193.735, 165.958], q_wxyz: [1, 0, 0, 0]}}}}\n"
      "tracker: {{sigma_mm: 0.02}}\n"
      "model: {{error_sources: [base], bias: {}}}\n",
      name, bias);
}

std::shared_ptr<const Cell> small_cell(const std::string& name, const std::string& bias) {
  return std::make_shared<const Cell>(
      demand(parse_cell(small_cell_yaml(name, bias), small_robot_yaml(), name + ".yaml")));
}

std::string small_batch_csv(const Cell& cell, const SmallBatch& batch) {
  const Pose X_FT = *cell.tools.begin()->second;
  std::mt19937_64 random(batch.seed);
  std::uniform_real_distribution<double> joint_deg(-60, 60);
  std::normal_distribution<double> noise(0, batch.noise);
  std::string csv = "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,x_mm,y_mm,z_mm";
  csv += batch.set.empty() ? "\n" : ",set\n";
  for (int row = 0; row < batch.poses; ++row) {
    JointVector q(cell.robot.size());
    for (int i = 0; i < q.size(); ++i) {
      const double value = joint_deg(random);
      q[i] = from_deg(value);
      csv += fmt::format("{:.6f},", value);
    }
    Vector3 p =
        (cell.robot.flange_pose(q) * X_FT).translation() + batch.base_shift * Vector3::UnitX();
    for (int axis = 0; axis < 3; ++axis) p[axis] += noise(random);
    csv += fmt::format("{:.6f},{:.6f},{:.6f}", to_mm(p.x()), to_mm(p.y()), to_mm(p.z()));
    csv += batch.set.empty() ? "\n" : "," + batch.set + "\n";
  }
  return csv;
}

CompensatedModel nominal_model(const std::shared_ptr<const Cell>& cell, int training_poses) {
  CompensatedModel::Parts parts;
  parts.physics = demand(make_physical_model(cell, {}));
  parts.q_min = JointVector::Constant(cell->robot.size(), from_deg(-60));
  parts.q_max = JointVector::Constant(cell->robot.size(), from_deg(60));
  parts.trained_with = {{"spindle", cell->payloads.empty() ? "" : cell->payloads.begin()->first}};
  parts.provenance.level = "none";
  parts.provenance.batch_id = "by-hand";
  parts.provenance.training_poses = training_poses;
  return demand(CompensatedModel::make(std::move(parts)));
}

}  // namespace trammel::test
