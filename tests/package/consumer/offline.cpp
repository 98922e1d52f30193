#include <cstdio>

#include "server/compensate/compensated_model.h"
#include "server/compensate/model_file.h"

// Predicts where the robot of a model really goes when all joints are at zero: offline MODEL
int main(int, char** arguments) {
  const auto model = trammel::load_model(arguments[1]);
  if (!model) return std::puts(model.error().message.c_str()), 3;
  const trammel::Cell& cell = model->cell();
  const trammel::JointVector q = trammel::JointVector::Zero(cell.robot.size());
  const auto error = model->predict(q, *resolve_tool(cell, ""), *resolve_payload(cell, "")).error_B;
  std::printf("%.3f mm\n", 1000 * error.norm());
}
