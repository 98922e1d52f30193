#include "tests/support/checked_robot.h"

#include "server/plan/plan.h"
#include "server/tasks/train/train.h"
#include "tests/support/demand.h"

namespace trammel::test {

namespace {

CheckedBatch as_batch(const std::string& csv, const Cell& cell, double held_out) {
  return demand(
      check_against_cell(demand(parse_batch_csv(csv, "check.csv")), cell, drawn(held_out, 1)));
}

}  // namespace

CheckedRobot trained_robot(const hidden::RobotSpec& spec, int poses, const std::string& bias) {
  hidden::TrainedRobot robot = hidden::draw_robot(spec);
  const auto cell = std::make_shared<const Cell>(
      demand(parse_cell(robot.cell_yaml, robot.robot_yaml, "cell.yaml")));
  TrainOptions options;
  options.bias = bias;
  CompensatedModel model = demand(train(cell, as_batch(robot.batch_csv, *cell, 0.2), options));
  PlanOptions plan;
  plan.count = poses;
  plan.criterion = PlanCriterion::kCheck;
  plan.orientation = spec.orientation;
  std::vector<hidden::Joints> planned;
  for (const PlannedPose& pose : demand(make_plan(cell, plan)).poses)
    planned.emplace_back(pose.context.q);
  return {std::move(robot), std::move(model), std::move(planned)};
}

MeasurementBatch measured_check(const CheckedRobot& robot, const Hidden& hidden,
                                std::uint64_t seed) {
  hidden::Random random(seed * 31 + 5);
  const std::string csv = hidden::check_csv(
      robot.robot, {robot.planned, hidden.effects, hidden.bad_pose, hidden.bad_mm}, random);
  return demand(parse_batch_csv(csv, "check.csv"));
}

HealthCheck checked(const CheckedRobot& robot, const Hidden& hidden, std::uint64_t seed,
                    const HealthOptions& options) {
  const MeasurementBatch batch = measured_check(robot, hidden, seed);
  return demand(check_health(
      robot.model, demand(check_against_cell(batch, robot.model.cell(), drawn(0, 1))), options));
}

}  // namespace trammel::test
