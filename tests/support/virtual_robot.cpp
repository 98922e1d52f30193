#include "tests/support/virtual_robot.h"

#include "server/base/text_file.h"
#include "server/plan/plan.h"
#include "tests/support/demand.h"

namespace trammel::test {

namespace {

const std::string kSource = TRAMMEL_SOURCE_DIR;

}  // namespace

std::shared_ptr<const Cell> cell_7() {
  return std::make_shared<const Cell>(demand(read_cell(kSource + "/config/cell-7.yaml")));
}

std::shared_ptr<const Cell> cell_7_unlocated() {
  auto cell = std::make_shared<Cell>(*cell_7());
  cell->X_WB.reset();
  cell->tools["spindle"].reset();
  return cell;
}

VirtualRobot chapter_5_robot(const std::shared_ptr<const Cell>& cell) {
  return demand(read_virtual_robot(kSource + "/models/truth/chapter-5.yaml", cell));
}

VirtualRobot with_zero_off(VirtualRobot robot, int joint, double rad) {
  const std::vector<Parameter> parameters = robot.truth.parameters();
  for (std::size_t k = 0; k < parameters.size(); ++k) {
    if (parameters[k].name == fmt::format("q{}", joint))
      robot.truth.values(static_cast<Eigen::Index>(k)) += rad;
  }
  return robot;
}

VirtualRobot in_warmth(VirtualRobot robot, double temperature, double growth) {
  const Eigen::Index first =
      add_source(robot.truth, demand(make_error_source("thermal_growth", *robot.truth.cell)));
  robot.truth.values(first) = growth;
  robot.course = {
      .seconds_per_pose = 20, .temperature_start = temperature, .temperature_end = temperature};
  return robot;
}

MeasurementBatch measured(const VirtualRobot& robot, int poses, std::uint64_t seed,
                          bool orientation) {
  const Eigen::MatrixXd q = demand(plan_poses(*robot.truth.cell, {poses, seed}));
  SimulateOptions options;
  options.seed = seed + 1000;
  options.orientation = orientation;
  MeasurementBatch batch = demand(simulate(robot, q, options));
  batch.id = "virtual";
  return batch;
}

}  // namespace trammel::test
