#include "server/compensate/arm_steps.h"

#include <string>

#include "server/robot/smallest_step.h"

namespace trammel {

namespace {

/// Callers request thousands of predictions, so each thread keeps the result for the last robot
/// file.
const ArmSteps& known_steps(const Cell& cell) {
  thread_local std::string of;
  thread_local ArmSteps steps;
  if (of != cell.robot_yaml) {
    steps = steps_of(cell).value_or(ArmSteps());
    of = cell.robot_yaml;
  }
  return steps;
}

}  // namespace

double smallest_step(const CompensatedModel& model, const PoseContext& context) {
  const Vector3 p_F = model.parts().physics.tools.at(context.tool).translation();
  return known_steps(model.cell()).smallest(model.cell().robot, context.q, p_F);
}

double least_rms(const CompensatedModel& model, const PoseContext& context) {
  return smallest_step(model, context) / kRadiusOfRms;
}

}  // namespace trammel
