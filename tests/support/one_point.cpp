#include "tests/support/one_point.h"

#include <random>

#include "server/base/text_file.h"
#include "server/robot/inverse_kinematics.h"
#include "tests/support/demand.h"

namespace trammel::test {

std::shared_ptr<const Cell> cell_of_one_point(const std::string& base, const std::string& tool,
                                              const std::string& model) {
  const std::string text = fmt::format(
      "version: 1\ncell: one-point\nrobot: robot.yaml\nbase: {}\ntools: {{tip: {}}}\n"
      "tracker: {{sigma_mm: 0.02}}\nmodel: {}\n",
      base, tool, model);
  return std::make_shared<const Cell>(demand(parse_cell(
      text, demand(read_text_file(TRAMMEL_SOURCE_DIR "/models/universal-robots_ur5.yaml")),
      "cell.yaml")));
}

MeasurementBatch one_point(const Cell& cell, const Vector3& off, const Pose& X_WB, int poses,
                           std::uint64_t seed) {
  const Vector3 drawn(0.03, 0, 0.15);
  JointVector q0(6);
  q0 << 0.6, -1.9, 1.6, -1.2, -1.4, 0.3;
  std::mt19937_64 random(seed);
  std::normal_distribution<double> noise(0, 0.02e-3);
  std::uniform_real_distribution<double> turn(-0.8, 0.8);
  const Pose X_BF0 = cell.robot.flange_pose(q0);
  const Vector3 point_B = X_BF0 * drawn;
  MeasurementBatch batch;
  batch.id = "one-point";
  while (static_cast<int>(batch.measurements.size()) < poses) {
    const Matrix3 R = rotation_exp({turn(random), turn(random), turn(random)}) * X_BF0.linear();
    const InverseResult inverse =
        inverse_kinematics(cell.robot, make_pose(R, point_B - R * drawn), q0);
    if (inverse.status != InverseStatus::kOk) continue;
    Measurement m;
    m.pose_id = fmt::format("p{}", batch.measurements.size() + 1);
    m.row = static_cast<int>(batch.measurements.size()) + 2;
    m.context.q = inverse.q;
    m.context.tool = "tip";
    m.p_W = X_WB * (cell.robot.flange_pose(inverse.q) * Vector3(drawn + off)) +
            Vector3(noise(random), noise(random), noise(random));
    batch.measurements.push_back(std::move(m));
  }
  return batch;
}

}  // namespace trammel::test
