#include "tests/support/three_reflectors.h"

#include <random>

#include "server/plan/plan.h"
#include "server/simulate/simulate.h"
#include "tests/support/demand.h"
#include "tests/support/virtual_robot.h"

namespace trammel::test {

std::shared_ptr<const Cell> cell_of_three_reflectors() {
  auto cell = std::make_shared<Cell>(*cell_7());
  const Pose spindle = *cell->tools.at("spindle");
  cell->tools = {{"a", spindle}, {"b", spindle}, {"c", spindle}};
  cell->tools["b"]->translation() += Vector3(0.1, -0.05, 0.12);
  cell->tools["c"]->translation() += Vector3(-0.08, 0.1, 0.05);
  return cell;
}

MeasurementBatch seen_by_three(int poses, double shared, double apart, std::uint64_t seed) {
  const auto cell = cell_of_three_reflectors();
  const VirtualRobot robot = chapter_5_robot(cell);
  const Eigen::MatrixXd q = demand(plan_poses(*cell, {poses, seed}));
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  const auto shift = [&](double size) -> Vector3 {
    return size * Vector3(normal(random), normal(random), normal(random));
  };
  MeasurementBatch batch;
  for (Eigen::Index pose = 0; pose < q.rows(); ++pose) {
    const Vector3 off = shift(shared);
    for (const char* tool : {"a", "b", "c"}) {
      SimulateOptions options;
      options.seed = 100 * seed + batch.measurements.size();
      options.orientation = false;
      options.tool = tool;
      options.payload = "spindle";
      Measurement m = demand(simulate(robot, q.row(pose), options)).measurements.front();
      m.p_W += off + shift(apart);
      m.row = static_cast<int>(batch.measurements.size()) + 2;
      m.pose_id = "p" + std::to_string(m.row);
      m.context.index = static_cast<int>(batch.measurements.size());
      batch.measurements.push_back(std::move(m));
    }
  }
  batch.id = "three";
  return batch;
}

MeasurementBatch seen_by_one(const MeasurementBatch& by_three) {
  MeasurementBatch one = by_three;
  std::erase_if(one.measurements, [](const Measurement& m) { return m.context.tool != "a"; });
  return one;
}

}  // namespace trammel::test
