// The time of the error budget of 300 poses beyond the fit, with and without a learned bias.
#include <chrono>

#include "server/compensate/budget/error_budget.h"
#include "server/tasks/train/train.h"
#include "tests/support/demand.h"
#include "tests/support/figure.h"
#include "tests/support/virtual_robot.h"

namespace trammel {
namespace {

using Clock = std::chrono::steady_clock;

double milliseconds_of_a_budget(const std::string& bias) {
  constexpr int kPoses = 300, kTimes = 20;
  const auto cell = test::cell_7();
  const MeasurementBatch batch = test::measured(test::chapter_5_robot(cell), kPoses, 61);
  TrainOptions options;
  options.level = "M3";
  options.bias = bias;
  const CompensatedModel model = test::demand(train(cell, batch, options));
  const auto began = Clock::now();
  for (int i = 0; i < kTimes; ++i) {
    if (error_budget(model, batch).as_it_stands.lines.empty()) return -1;
  }
  return std::chrono::duration<double, std::milli>(Clock::now() - began).count() / kTimes;
}

}  // namespace
}  // namespace trammel

int main() {
  trammel::test::tell_figure("budget of 300 poses, ms", trammel::milliseconds_of_a_budget("none"));
  trammel::test::tell_figure("budget of 300 poses with a learned bias, ms",
                             trammel::milliseconds_of_a_budget("se"));
  return 0;
}
