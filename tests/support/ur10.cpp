#include "tests/support/ur10.h"

#include <filesystem>
#include <utility>

#include "server/measurement/files/batch_file.h"
#include "server/robot/cell_file.h"
#include "tests/support/demand.h"

namespace trammel::test {

namespace {

std::string file_of(const std::string& series) {
  return std::string(TRAMMEL_SOURCE_DIR) + "/../shared/data/ur10_series_" + series + ".csv";
}

}  // namespace

bool has_ur10() { return std::filesystem::exists(file_of("c")); }

std::shared_ptr<const Cell> ur10_cell() {
  return std::make_shared<const Cell>(
      demand(read_cell(std::string(TRAMMEL_SOURCE_DIR) + "/config/ur10.yaml")));
}

MeasurementBatch ur10_series(const std::string& name, int training, int stride, int held_stride) {
  MeasurementBatch all = demand(read_batch_csv(file_of(name)));
  std::vector<Measurement> taken;
  int seen = 0, seen_held = 0;
  for (Measurement& m : all.measurements) {
    const bool held = std::stoi(m.pose_id) % 10 >= 7;
    m.set = held ? MeasurementSet::kValidation : MeasurementSet::kTrain;
    if (held && seen_held++ % held_stride != 0) continue;
    if (!held && (seen++ % stride != 0 || training-- <= 0)) continue;
    taken.push_back(std::move(m));
  }
  all.measurements = std::move(taken);
  return all;
}

}  // namespace trammel::test
