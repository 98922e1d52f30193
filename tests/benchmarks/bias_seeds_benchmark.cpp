// The share of seeds that find the best optimum of a bias: `bias_seeds_benchmark [--data FOLDER]
// [--seeds N] [--coupled N]`. FOLDER (default ../shared/data) holds the measured UR10; where it is
// not at hand, its rows are skipped.
#include <algorithm>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <filesystem>

#include "server/base/check.h"
#include "server/bias/bias_model.h"
#include "server/calibrate/calibrate.h"
#include "server/measurement/checked_batch.h"
#include "server/measurement/files/batch_file.h"
#include "server/measurement/repeats.h"
#include "server/tasks/train/leftover.h"
#include "server/tasks/train/train.h"
#include "tests/support/figure.h"
#include "tests/support/virtual_robot.h"

namespace trammel {
namespace {

// Processor seconds: other programs run here too.
double processor_seconds() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

BiasProblem left_by(const std::shared_ptr<const Cell>& cell,
                    const std::vector<std::string>& sources, const MeasurementBatch& batch) {
  const auto found = calibrate(cell, sources, batch, {});
  TRAMMEL_CHECK(found.has_value());
  BiasProblem problem = leftover(found->model, batch);
  const BiasPhysics physics(found->model);
  for (const Measurement& m : batch.measurements) problem.features.push_back(physics.at(m.context));
  return problem;
}

// Every pose whose id ends in 0 to 6, as the tests train on.
BiasProblem measured_ur10(const std::string& file) {
  const auto cell =
      std::make_shared<const Cell>(read_cell(TRAMMEL_SOURCE_DIR "/config/ur10.yaml").value());
  MeasurementBatch batch = check_against_cell(read_batch_csv(file).value(), *cell).value().rows();
  std::erase_if(batch.measurements,
                [](const Measurement& m) { return std::stoi(m.pose_id) % 10 >= 7; });
  batch = merge_repeats(batch, cell->tracker.sigma).batch;
  return left_by(cell, {"base", "geometry", "compliance", "tool"}, batch);
}

BiasProblem sag_of_the_virtual_robot() {
  const auto cell = test::cell_7();
  return left_by(cell, {"base", "geometry"}, test::measured(test::chapter_5_robot(cell), 800, 5));
}

void print_row(const char* data, const BiasProblem& problem, const char* kernel, int seeds) {
  std::vector<double> nats;
  const double start = processor_seconds();
  for (int seed = 1; seed <= seeds; ++seed) {
    BiasOptions options;
    options.kernel = kernel;
    options.seed = static_cast<std::uint64_t>(seed);
    const auto model = BiasModel::fit(problem, options);
    TRAMMEL_CHECK(model.has_value());
    nats.push_back(model->report().log_likelihood.sum());
    std::fprintf(stderr, "%s, %s, seed %d: %.2f nat\n", data, kernel, seed, nats.back());
  }
  if (nats.empty()) return;
  const double seconds = (processor_seconds() - start) / seeds;
  const auto [worst, best] = std::minmax_element(nats.begin(), nats.end());
  const auto within = [&, best = *best](double nat) {
    return std::count_if(nats.begin(), nats.end(),
                         [&](double value) { return value > best - nat; });
  };
  std::printf(
      "%-14s %-36s %6td poses: %ld of %d seeds within 0.2 nat of the best, %ld within 1; worst "
      "%.2f below %.2f; %.1f s a fit\n",
      data, kernel, problem.q.rows(), within(0.2), seeds, within(1.0), *best - *worst, *best,
      seconds);
  test::tell_figure(fmt::format("{}, {}, share of seeds within 1 nat of the best, %", data, kernel),
                    100.0 * static_cast<double>(within(1.0)) / seeds);
  test::tell_figure(fmt::format("{}, {}, processor s a fit", data, kernel), seconds);
}

int run(const std::string& folder, int seeds, int coupled) {
  print_row("virtual sag", sag_of_the_virtual_robot(), "se", seeds);
  const std::string file = folder + "/ur10_series_c.csv";
  if (!std::filesystem::exists(file)) {
    std::printf("%s is not at hand: nothing asked of the measured UR10\n", file.c_str());
    return 0;
  }
  const BiasProblem ur10 = measured_ur10(file);
  print_row("UR10 series C", ur10, "se", seeds);
  print_row("UR10 series C", ur10, "matern52 + joint_map + parameters", coupled);
  return 0;
}

}  // namespace
}  // namespace trammel

int main(int argc, char** argv) {
  std::string folder = TRAMMEL_SOURCE_DIR "/../shared/data";
  int seeds = 20;
  int coupled = 5;  // their fits take longer
  for (int i = 1; i + 1 < argc; i += 2) {
    if (std::strcmp(argv[i], "--data") == 0) folder = argv[i + 1];
    if (std::strcmp(argv[i], "--seeds") == 0) seeds = std::atoi(argv[i + 1]);
    if (std::strcmp(argv[i], "--coupled") == 0) coupled = std::atoi(argv[i + 1]);
  }
  return trammel::run(folder, seeds, coupled);
}
