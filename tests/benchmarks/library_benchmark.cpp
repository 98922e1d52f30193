// The cost of asking libtrammel and the Python package for 10,000 predictions, in processor time,
// beside the rooms that the program `trammel` is made of: the same model, joints and portions, one
// thread. All take turns, and the best of each counts.
#include <time.h>

#include <algorithm>
#include <cstdio>
#include <limits>
#include <string>
#include <vector>

#include "clients/library/trammel/offline.h"
#include "server/base/check.h"
#include "server/base/units.h"
#include "server/compensate/model_file.h"
#include "server/measurement/pose_check.h"
#include "tests/support/demand.h"
#include "tests/support/process.h"
#include "tests/support/temporary_folder.h"

namespace trammel {
namespace {

using test::demand;

constexpr int kPredictions = 10000;
constexpr int kTrainingPoses = 300;
constexpr int kRounds = 7;
constexpr std::size_t kTogether = 256;  // as the program and the library take them

double processor_s() {
  timespec used{};
  ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &used);
  return static_cast<double>(used.tv_sec) + 1e-9 * static_cast<double>(used.tv_nsec);
}

template <typename T>
T demand_api(api::Result<T> result) {
  if (!result) std::puts(result.error().sentence.c_str());
  TRAMMEL_CHECK(result.has_value());
  return std::move(*result);
}

/// Best of all rounds, s.
struct Best {
  double s = std::numeric_limits<double>::infinity();
  template <typename Work>
  void measure(const Work& work) {
    for (int i = 0; i < 3; ++i) {
      const double began = processor_s();
      work();
      s = std::min(s, processor_s() - began);
    }
  }
};

/// How the program predicts, with what it makes of each pose.
double predicted_by_rooms(const CompensatedModel& model, const std::vector<double>& joints_deg) {
  const Cell& cell = model.cell();
  const auto n = static_cast<std::size_t>(cell.robot.size());
  double sum = 0;
  std::vector<PoseContext> poses(joints_deg.size() / n);
  for (std::size_t i = 0; i < poses.size(); ++i) {
    poses[i].q.resize(cell.robot.size());
    for (std::size_t j = 0; j < n; ++j)
      poses[i].q(static_cast<Eigen::Index>(j)) = from_deg(joints_deg[n * i + j]);
    poses[i].tool = cell.tools.begin()->first;
    poses[i].payload = cell.payloads.begin()->first;
    poses[i].served = true;
    TRAMMEL_CHECK(check_pose(poses[i], cell).has_value());
  }
  for (std::size_t first = 0; first < poses.size(); first += kTogether) {
    const auto from = poses.begin() + static_cast<std::ptrdiff_t>(first);
    const std::vector<PoseContext> portion(
        from, from + static_cast<std::ptrdiff_t>(std::min(kTogether, poses.size() - first)));
    for (const ErrorPrediction& p : model.predict_all(portion)) sum += p.error_B.norm();
  }
  return sum;
}

double sum_of(const std::vector<api::Prediction>& predictions) {
  double sum = 0;
  for (const api::Prediction& p : predictions)
    sum += Vector3(p.error_mm[0], p.error_mm[1], p.error_mm[2]).norm();
  return from_mm(sum);
}

/// Processor time of the Python package for the same, s, and the sum of the errors, m.
std::pair<double, double> python(const std::string& model, const std::string& plan) {
  const test::Finished done =
      test::run({"/usr/bin/env", "PYTHONPATH=" TRAMMEL_BINARY_DIR "/clients/python",
                 "PYTHONDONTWRITEBYTECODE=1", "OPENBLAS_NUM_THREADS=1", "/usr/bin/python3",
                 TRAMMEL_SOURCE_DIR "/tests/benchmarks/library_predictions.py", model, plan},
                std::chrono::minutes(2));
  if (done.exit_code != 0) std::puts(done.err.c_str());
  TRAMMEL_CHECK(done.exit_code == 0);
  const std::size_t space = done.out.find(' ');
  return {std::stod(done.out), std::stod(done.out.substr(space))};
}

void compare(const char* bias) {
  const std::string source = TRAMMEL_SOURCE_DIR;
  const auto cell = demand_api(api::Cell::load(source + "/config/cell-7.yaml"));
  const auto measured = demand_api(api::plan(cell, {.count = kTrainingPoses}));
  const auto batch =
      demand_api(api::simulate(cell, source + "/models/truth/chapter-5.yaml", measured.csv));
  const std::vector<api::Batch> batches = {batch};
  const auto model =
      demand_api(api::train(cell, batches, {.level = "M2", .bias = bias, .progress = {}}));
  const test::TemporaryFolder folder;
  TRAMMEL_CHECK(model.save(folder.file("a.model")).has_value());
  const auto asked = demand_api(api::plan(cell, {.count = kPredictions, .seed = 2}));
  const std::string joints = folder.write("asked.csv", asked.csv);
  const CompensatedModel rooms = demand(load_model(folder.file("a.model")));

  Best by_rooms, by_library;
  double by_python = std::numeric_limits<double>::infinity(), sum = 0;
  for (int round = 0; round < kRounds; ++round) {
    by_rooms.measure([&] { sum = predicted_by_rooms(rooms, asked.joints_deg); });
    double same = 0;
    by_library.measure([&] { same = sum_of(demand_api(model.predict(asked.joints_deg))); });
    const auto [s, errors] = python(folder.file("a.model"), joints);
    by_python = std::min(by_python, s);
    TRAMMEL_CHECK(std::abs(same - sum) <= 1e-9 * sum && std::abs(errors - sum) <= 1e-9 * sum);
  }
  std::printf(
      "10000 predictions, bias %s, processor ms: rooms %.1f, libtrammel %.1f, Python %.1f\n", bias,
      1e3 * by_rooms.s, 1e3 * by_library.s, 1e3 * by_python);
  std::printf("figure 10000 predictions in Python over C++, bias %s: %.3f\n", bias,
              by_python / by_library.s);
  std::printf("figure 10000 predictions of libtrammel over the program's rooms, bias %s: %.3f\n",
              bias, by_library.s / by_rooms.s);
}

}  // namespace
}  // namespace trammel

int main() {
  for (const char* bias : {"se", "none"}) trammel::compare(bias);
}
