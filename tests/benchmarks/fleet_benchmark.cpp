// The cost of a cell for a daemon: how long a start takes with many cells, how much memory a model
// needs, how long others wait for a swap, and how long a large store takes to open. One figure a
// line. --cells N, --poses N, --store-gb N.
#include <SQLiteCpp/SQLiteCpp.h>
#include <malloc.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <fstream>
#include <iostream>
#include <random>

#include "server/compensate/model_file.h"
#include "server/trainer/trainer.h"
#include "tests/support/demand.h"
#include "tests/support/small_cell.h"
#include "tests/support/temporary_folder.h"

namespace trammel {
namespace {

using test::demand;
using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point begin) {
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

void print(const std::string& name, double value) {
  std::cout << fmt::format("figure {}: {:.4g}\n", name, value);
}

/// Resident memory of this process, MB.
double resident() {
  ::malloc_trim(0);
  std::ifstream in("/proc/self/statm");
  long total = 0, pages = 0;
  in >> total >> pages;
  return static_cast<double>(pages) * static_cast<double>(::sysconf(_SC_PAGESIZE)) / 1e6;
}

/// A bias of `se` over the joint range, as a training leaves it: signal 0.2 mm, noise 0.03 mm.
BiasState learned(int poses, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> joint(-1.0, 1.0);
  std::normal_distribution<double> noise(0, 3e-5);
  BiasState state;
  state.kernel = "se";
  state.q = Eigen::MatrixXd::NullaryExpr(poses, 6, [&] { return joint(random); });
  state.residual_B.resize(poses, 3);
  for (int i = 0; i < poses; ++i) {
    for (int axis = 0; axis < 3; ++axis)
      state.residual_B(i, axis) =
          2e-4 * std::sin(1.3 * state.q(i, axis) + state.q(i, axis + 2)) + noise(random);
  }
  state.sigma = Eigen::VectorXd::Constant(poses, 2e-5);
  state.offset = Eigen::VectorXd::Zero(3);
  state.hyperparameters.resize(8, 3);
  state.hyperparameters.topRows(6).setConstant(std::log(1.5));
  state.hyperparameters.row(6).setConstant(std::log(2e-4));
  state.hyperparameters.row(7).setConstant(std::log(3e-5));
  return state;
}

CompensatedModel model_of(const std::shared_ptr<const Cell>& cell, int poses, std::uint64_t seed) {
  ModelParts parts = test::nominal_model(cell, poses).parts();
  parts.bias = learned(poses, seed);
  parts.prior_share_limit = 1;
  return demand(CompensatedModel::make(std::move(parts)));
}

struct Fleet {
  test::TemporaryFolder folder;
  ServedCells cells;
  std::string path = folder.file("fleet.db");
};

/// Two versions of each cell; the second is in force.
void fill(Fleet& fleet, int cells, int poses) {
  const auto store = demand(Store::open(fleet.path));
  for (int i = 0; i < cells; ++i) {
    const std::string name = fmt::format("cell-{}", i);
    const auto cell = test::small_cell(name, "se");
    fleet.cells[name] = cell;
    for (int version = 1; version <= (i == 0 ? 2 : 1); ++version)
      static_cast<void>(demand(store->add_model(
          name, model_of(cell, poses, static_cast<std::uint64_t>(version)), 0, true, "")));
  }
}

void measure_start_and_swap(Fleet& fleet) {
  const auto begin = Clock::now();
  const auto store = demand(Store::open(fleet.path));
  ModelRegistry registry;
  Trainer trainer(fleet.cells, *store, registry, {});
  const auto notices = demand(trainer.take_up());
  print("ready with all cells, s", seconds_since(begin));
  for (const std::string& notice : notices) std::cout << notice << "\n";
  const auto one = Clock::now();
  static_cast<void>(registry.in_force(std::prev(fleet.cells.end())->first));
  print("a cold model, s", seconds_since(one));
  static_cast<void>(demand(registry.version("cell-0", 1)));
  double worst = 0;
  for (int i = 0; i < 20; ++i) {
    const auto asked = Clock::now();
    if (!trainer.activate("cell-0", 1 + i % 2)) std::cout << "a swap failed\n";
    worst = std::max(worst, seconds_since(asked));
  }
  print("a swap, worst of 20, ms", 1e3 * worst);
}

void measure_memory(const Fleet& fleet, int poses) {
  constexpr int kModels = 10;
  const auto store = demand(Store::open(fleet.path));
  std::vector<CompensatedModel> models;
  models.push_back(demand(store->model("cell-0", 1)));  // whatever the first one leaves behind
  const double before = resident();
  for (int i = 0; i < kModels; ++i) models.push_back(demand(store->model("cell-0", 1 + i % 2)));
  const double each = (resident() - before) / kModels;
  print("memory of a model, MB", each);
  print("as the registry counts it, MB", static_cast<double>(bytes_of(models.back())) / 1e6);
  // Three triangles, the features of the poses, the weights and what was measured.
  const double n = poses;
  print("memory of a model over what predicts",
        each / ((3 * n * n / 2 * 8 + n * 3 * (8 + 2) * 8) / 1e6));
}

void measure_large_store(int gigabytes) {
  const test::TemporaryFolder folder;
  const std::string path = folder.file("large.db");
  const auto cell = test::small_cell("cell-7");
  {
    const auto store = demand(Store::open(path));
    static_cast<void>(
        demand(store->add_model("cell-7", test::nominal_model(cell, 1), 0, true, "")));
  }
  {
    SQLite::Database file(path, SQLite::OPEN_READWRITE);
    file.exec("PRAGMA journal_mode = OFF; PRAGMA synchronous = OFF");
    file.exec(
        "INSERT INTO jobs (id, cell, level, bias, state, message, created_at) VALUES (1, 'cell-7', "
        "'', '', 'done', '', 0)");
    for (int i = 0; i < 100 * gigabytes; ++i)
      file.exec(
          fmt::format("INSERT INTO batches (cell, id, csv, hash, request_id, accepted_at, poses, "
                      "job) VALUES ('cell-7', '{}', zeroblob(10000000), '', '', 0, 1, 1)",
                      i));
  }
  ::sync();  // what was just written is no part of a start
  const auto begin = Clock::now();
  const auto store = demand(Store::open(path));
  ModelRegistry registry;
  Trainer trainer({{"cell-7", cell}}, *store, registry, {});
  static_cast<void>(demand(trainer.take_up()));
  print(fmt::format("ready with a store of {} GB, s", gigabytes), seconds_since(begin));
  if (!registry.in_force("cell-7")) std::cout << "no model is served\n";
}

}  // namespace
}  // namespace trammel

int main(int argc, char** argv) {
  CLI::App app("What a cell costs a daemon.");
  int cells = 200, poses = 1200, gigabytes = 10;
  app.add_option("--cells", cells)->check(CLI::Range(1, 1024));
  app.add_option("--poses", poses)->check(CLI::Range(10, 5000));
  app.add_option("--store-gb", gigabytes)->check(CLI::Range(0, 100));
  CLI11_PARSE(app, argc, argv);
  trammel::Fleet fleet;
  trammel::fill(fleet, cells, poses);
  trammel::measure_memory(fleet, poses);
  trammel::measure_start_and_swap(fleet);
  if (gigabytes > 0) trammel::measure_large_store(gigabytes);
}
