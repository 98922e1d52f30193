// `error_sources: auto` on measured robots (../shared/data) and on arms of the second simulation,
// whose true causes another training is told. `auto_benchmark [--only ur5|ur5p|wam|c|d|arms]
// [--arms N] [--poses N]`. Prints rms (or mean, where that is published) of poses held out, their
// share inside 95 %, and processor seconds of the whole training.
#include <cstdio>
#include <cstring>
#include <ctime>
#include <filesystem>

#include "clients/cli/text/evaluation_text.h"
#include "server/base/text_file.h"
#include "server/base/units.h"
#include "server/measurement/files/batch_file.h"
#include "server/numerics/seeded_random.h"
#include "server/tasks/train/train.h"
#include "tests/support/demand.h"
#include "tests/support/figure.h"
#include "tests/support/from_rows.h"
#include "tests/support/heavy_arm.h"
#include "tests/support/ur10.h"

namespace trammel {
namespace {

using test::demand;
using test::tell_figure;

const std::string kData = TRAMMEL_SOURCE_DIR "/../shared/data/";
constexpr const char* kCell =
    "version: 1\ncell: {}\nrobot: robot.yaml\nbase: null\ntools: {{reflector: null}}\n"
    "tracker: {{sigma_mm: 0.01}}\nmodel: {{error_sources: auto}}\n";
constexpr const char* kUr5 =
    "version: 1\nname: UR5\njoints:\n"
    "  - {d_mm: 89.159, alpha_deg: 90, limits_deg: [-360, 360]}\n"
    "  - {a_mm: -425, hayati: true, limits_deg: [-360, 360]}\n"
    "  - {a_mm: -392.25, hayati: true, limits_deg: [-360, 360]}\n"
    "  - {d_mm: 109.15, alpha_deg: 90, limits_deg: [-360, 360]}\n"
    "  - {d_mm: 94.65, alpha_deg: -90, limits_deg: [-360, 360]}\n"
    "  - {d_mm: 82.3, limits_deg: [-360, 360]}\n";
constexpr const char* kWam =
    "version: 1\nname: WAM\njoints:\n"
    "  - {alpha_deg: -90, limits_deg: [-360, 360]}\n"
    "  - {alpha_deg: 90, limits_deg: [-360, 360]}\n"
    "  - {d_mm: 550, a_mm: 45, alpha_deg: -90, limits_deg: [-360, 360]}\n"
    "  - {a_mm: -45, alpha_deg: 90, limits_deg: [-360, 360]}\n"
    "  - {d_mm: 300, alpha_deg: -90, limits_deg: [-360, 360]}\n"
    "  - {alpha_deg: 90, limits_deg: [-360, 360]}\n"
    "  - {d_mm: 60, limits_deg: [-360, 360]}\n";

double seconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

std::shared_ptr<const Cell> cell_of(const std::string& name, const char* robot) {
  return std::make_shared<const Cell>(
      demand(parse_cell(fmt::format(fmt::runtime(kCell), name), robot, name)));
}

/// The grid to train on; the random poses, or `held` rows of the grid, to judge by.
MeasurementBatch split_rows_of(const std::string& name, std::size_t held) {
  MeasurementBatch all = demand(read_batch_csv(kData + name + "_grid.csv"));
  if (held == 0) {
    MeasurementBatch random = demand(read_batch_csv(kData + name + "_random.csv"));
    for (Measurement& m : random.measurements) {
      m.set = MeasurementSet::kValidation;
      m.row += static_cast<int>(all.measurements.size());
      m.pose_id += "r";
      all.measurements.push_back(std::move(m));
    }
    return all;
  }
  SeededRandom random(1);
  const auto order = shuffled_rows(std::ssize(all.measurements), &random);
  for (std::size_t k = 0; k < held; ++k)
    all.measurements[static_cast<std::size_t>(order[k])].set = MeasurementSet::kValidation;
  return all;
}

void tell(const std::string& name, const std::shared_ptr<const Cell>& cell,
          const MeasurementBatch& batch, TrainOptions options) {
  const double begin = seconds();
  const CompensatedModel model = demand(train(cell, batch, options));
  const double took = seconds() - begin;
  const Evaluation& held = *model.parts().validation;
  tell_figure("auto " + name + ", nominal, mm", to_mm(held.nominal.rms));
  tell_figure("auto " + name + ", physics, mm", to_mm(held.calibrated.rms));
  tell_figure("auto " + name + ", mm", to_mm(held.compensated.rms));
  tell_figure("auto " + name + ", mean, mm", to_mm(held.compensated.mean));
  tell_figure("auto " + name + ", inside 95 %", 100 * held.coverage_95);
  tell_figure("auto " + name + ", processor s", took);
  std::printf("%s\n", cli::model_text(model).c_str());
}

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
  using namespace trammel;
  std::string only;
  int count = 30, poses = 200;
  for (int i = 1; i + 1 < argc; i += 2) {
    if (std::strcmp(argv[i], "--only") == 0) only = argv[i + 1];
    if (std::strcmp(argv[i], "--arms") == 0) count = std::atoi(argv[i + 1]);
    if (std::strcmp(argv[i], "--poses") == 0) poses = std::atoi(argv[i + 1]);
  }
  const auto asked = [&](const char* name) { return only.empty() || only == name; };
  if (!std::filesystem::exists(kData + "ur5_grid.csv")) {
    std::puts("the measured robots are not at hand (../shared/data)");
  } else {
    if (asked("ur5")) tell("UR5", cell_of("ur5", kUr5), split_rows_of("ur5", 300), {});
    if (asked("ur5p")) tell("UR5 published", cell_of("ur5", kUr5), split_rows_of("ur5", 0), {});
    if (asked("wam")) tell("WAM published", cell_of("wam", kWam), split_rows_of("wam", 0), {});
    for (const char* name : {"c", "d"})
      if (asked(name))
        tell(std::string("UR10 ") + name, test::ur10_cell(), test::ur10_series(name), automatic());
  }
  if (asked("arms")) arms(count, poses);
}
