// `error_sources: auto` on arms of the second simulation, beside a training that is told their true
// causes: `auto_benchmark [--arms N] [--poses N]`. Measured robots: tests/benchmarks/public.
#include <cstdio>
#include <cstring>

#include "server/base/units.h"
#include "server/tasks/train/train.h"
#include "tests/support/demand.h"
#include "tests/support/figure.h"
#include "tests/support/from_rows.h"
#include "tests/support/heavy_arm.h"

namespace trammel {
namespace {

using test::demand;
using test::tell_figure;

TrainOptions automatic() {
  TrainOptions options;
  options.level = "auto";
  options.bias = "auto";
  return options;
}

/// By itself over told, held out, of so many arms.
void arms(int count, int poses) {
  double by_itself = 0, told = 0;
  for (int seed = 1; seed <= count; ++seed) {
    const test::HeavyArm arm = test::draw_heavy_arm(
        {.seed = static_cast<std::uint64_t>(seed), .soft_foot = seed % 3 == 0});
    const MeasurementBatch batch = test::measured(arm, poses, 1);
    const MeasurementBatch fresh = test::measured(arm, 500, 2);
    TrainOptions truth = automatic();
    truth.level = seed % 3 == 0 ? "M3,self_weight,base_compliance" : "M3,self_weight";
    truth.bias = "none";
    const auto missed = [&](const TrainOptions& options) {
      return demand(train(arm.cell, batch, options)).evaluate(fresh).compensated.rms;
    };
    const double one = missed(automatic()), other = missed(truth);
    std::printf("arm %d: by itself %.4f mm, told %.4f mm\n", seed, to_mm(one), to_mm(other));
    by_itself += one * one;
    told += other * other;
  }
  tell_figure(fmt::format("auto {} drawn arms, {} poses, by itself over told", count, poses),
              std::sqrt(by_itself / told));
}

}  // namespace
}  // namespace trammel

int main(int argc, char** argv) {
  int count = 30, poses = 200;
  for (int i = 1; i + 1 < argc; i += 2) {
    if (std::strcmp(argv[i], "--arms") == 0) count = std::atoi(argv[i + 1]);
    if (std::strcmp(argv[i], "--poses") == 0) poses = std::atoi(argv[i + 1]);
  }
  trammel::arms(count, poses);
}
