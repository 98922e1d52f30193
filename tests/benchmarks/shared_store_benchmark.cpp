// The cost of a PostgreSQL on the same host: to accept a batch, to see what is in force in
// 10,000 cells, to start with 1,000 cells, to claim jobs, and until what one server puts in force
// is served by another. A commit waits for the disk. One figure a line. --only
// accept|list|ready|claims|served, --batches N that are there already.
#include <signal.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <filesystem>
#include <thread>

#include "server/base/hash.h"
#include "server/base/text_file.h"
#include "server/store/store.h"
#include "tests/support/daemon.h"
#include "tests/support/demand.h"
#include "tests/support/figure.h"
#include "tests/support/postgres.h"
#include "tests/support/small_cell.h"
#include "tests/support/virtual_cell.h"

namespace trammel {
namespace {

using test::demand;
using Clock = std::chrono::steady_clock;

constexpr std::chrono::seconds kLimit{120};
constexpr int kManyCells = 10'000, kVersionsOfEach = 20;
constexpr int kCellsOfServer = 1'000;
constexpr const char* kServed = "served";  // the cell of the servers

void demand_done(const Status& done) {
  static_cast<void>(demand(done ? Result<int>(0) : Result<int>(tl::make_unexpected(done.error()))));
}

double ms_since(Clock::time_point begin) {
  return std::chrono::duration<double, std::milli>(Clock::now() - begin).count();
}

double quantile(std::vector<double> times, double share) {
  std::sort(times.begin(), times.end());
  return times.at(static_cast<std::size_t>(share * static_cast<double>(times.size() - 1)));
}

void tell_quantiles(const std::string& name, const std::vector<double>& times) {
  test::tell_figure(name + ", p50, ms", quantile(times, 0.5));
  test::tell_figure(name + ", p99, ms", quantile(times, 0.99));
}

/// Rows of years: what a decision must not have to read through.
void fill(const test::Postgres& database, const std::string& url, int batches) {
  const std::string cells = fmt::format("generate_series(1, {}) AS c", kManyCells);
  const std::string number = fmt::format("(c - 1) * {} + v", kVersionsOfEach);
  const std::string checks_off = "SET session_replication_role = replica; ";
  database.sql(url, fmt::format("INSERT INTO cells SELECT 'cell-' || c, {} FROM {}",
                                kVersionsOfEach, cells));
  database.sql(url,
               fmt::format("{}INSERT INTO models SELECT 'cell-' || c, v, 'id', md5(({})::text), "
                           "'none', 'b', 0, 300, 0, 'x' FROM {}, generate_series(1, {}) AS v",
                           checks_off, number, cells, kVersionsOfEach));
  database.sql(url, fmt::format("{}INSERT INTO activations (number, cell, version, back, "
                                "activated_at) SELECT {}, 'cell-' || c, v, CASE WHEN v > 1 THEN {} "
                                "- 1 END, 0 FROM {}, generate_series(1, {}) AS v",
                                checks_off, number, number, cells, kVersionsOfEach));
  const std::string cell = fmt::format("'cell-' || (1 + b % {})", kManyCells);
  const std::string rows = fmt::format("generate_series(1, {}) AS b", batches);
  database.sql(url,
               fmt::format("{}INSERT INTO jobs (id, cell, level, bias, state, message, created_at, "
                           "model_version) SELECT b, {}, '', '', 'done', '', 0, 1 FROM {}",
                           checks_off, cell, rows));
  database.sql(
      url, fmt::format("{}INSERT INTO batches (cell, id, csv, hash, request_id, accepted_at, "
                       "poses, job) SELECT {}, 'b' || b, 'x', md5(b::text), '', 0, 300, b FROM {}",
                       checks_off, cell, rows));
  database.sql(url, fmt::format("{}INSERT INTO job_batches SELECT b, 0, {}, 'b' || b FROM {}",
                                checks_off, cell, rows));
  for (const char* table : {"jobs", "activations"})
    database.sql(
        url, fmt::format(
                 "SELECT setval(pg_get_serial_sequence('{0}', '{1}'), (SELECT MAX({1}) FROM {0}))",
                 table, table == std::string("jobs") ? "id" : "number"));
  database.sql(url, "ANALYZE");
}

StoredBatch batch_of(const std::string& cell, int number, const std::string& csv) {
  StoredBatch batch{cell, fmt::format("new-{}", number), csv + fmt::format("# {}\n", number), "",
                    fmt::format("r{}", number)};
  batch.hash = sha256_hex(batch.csv);
  batch.poses = 300;
  return batch;
}

void measure_accepting(const std::string& url) {
  const auto store = demand(Store::open(url));
  const std::string csv = test::virtual_batch_csv(300, 1);
  std::vector<double> times;
  for (int i = 0; i < 300; ++i) {
    const StoredBatch batch = batch_of("cell-1", i, csv);
    StoredJob job;
    job.cell = batch.cell;
    job.batch_ids = {batch.id};
    const auto begin = Clock::now();
    if (!store->batch_record(batch.cell, batch.id))
      static_cast<void>(demand(store->add_batch(batch, job)));
    times.push_back(ms_since(begin));
  }
  tell_quantiles("shared store: a batch of 300 poses is stored", times);
}

/// A server of the shipped cell with that record, under a name that fill() does not use: its
/// versions are no models.
void configure(const test::Daemon& daemon, const std::string& url, const std::string& keys) {
  const std::filesystem::path file =
      std::filesystem::path(daemon.config_path()).parent_path() / "cell-7.yaml";
  std::string text = test::read_file(file);
  const std::string name = "cell: cell-7";
  if (const std::size_t at = text.find(name); at != std::string::npos)
    demand_done(
        write_text_file(file, text.replace(at, name.size(), fmt::format("cell: {}", kServed))));
  demand_done(
      write_text_file(daemon.config_path(),
                      fmt::format("version: 1\nserver: {}\ncells: [cell-7.yaml]\nstore: '{}'\n{}",
                                  daemon.name(), url, keys)));
}

void measure_accepting_by_service(const std::string& url) {
  test::Daemon daemon;
  configure(daemon, url, "trains: false\n");
  daemon.start();
  const auto session = demand(client::Session::open(daemon.session_options()));
  std::vector<double> times;
  for (int i = 0; i < 200; ++i) {
    const std::string csv = test::virtual_batch_csv(300, static_cast<std::uint64_t>(i + 1));
    const auto begin = Clock::now();
    static_cast<void>(
        demand(session->submit_measurements(kServed, fmt::format("served-{}", i), csv)));
    times.push_back(ms_since(begin));
  }
  tell_quantiles("shared store: a batch of 300 poses is accepted by the service", times);
}

void measure_listing(const std::string& url) {
  const auto store = demand(Store::open(url));
  std::vector<double> times;
  std::size_t cells = 0;
  for (int i = 0; i < 11; ++i) {
    const auto begin = Clock::now();
    cells = demand(store->versions_in_force()).size();
    times.push_back(ms_since(begin));
  }
  test::tell_figure("shared store: cells listed", static_cast<double>(cells));
  test::tell_figure("shared store: 10,000 cells with what is in force, median, ms",
                    quantile(times, 0.5));
  test::tell_figure("shared store: 10,000 cells with what is in force, longest, ms",
                    quantile(times, 1));
}

void measure_start(const std::string& url) {
  const test::Daemon daemon;
  const std::filesystem::path folder = std::filesystem::path(daemon.config_path()).parent_path();
  demand_done(write_text_file(folder / "robot.yaml", test::small_robot_yaml()));
  std::string names;
  {
    const auto store = demand(Store::open(url));
    for (int i = 1; i <= kCellsOfServer; ++i) {
      const std::string name = fmt::format("s-{}", i);
      names += fmt::format("{}{}.yaml", i == 1 ? "" : ", ", name);
      demand_done(write_text_file(folder / (name + ".yaml"), test::small_cell_yaml(name)));
      static_cast<void>(demand(
          store->add_model(name, test::nominal_model(test::small_cell(name), 40), 0, true, "")));
    }
  }
  demand_done(write_text_file(daemon.config_path(),
                              fmt::format("version: 1\nserver: {}\ncells: [{}]\nstore: '{}'\n",
                                          daemon.name(), names, url)));
  for (const char* name : {"the first time", "again"}) {
    const auto begin = Clock::now();
    test::Process process(daemon.command_line());
    if (!process.wait_for_line("ready", kLimit))
      fmt::print("not ready: {}\n", process.standard_error());
    test::tell_figure(fmt::format("shared store: a server of 1,000 cells is ready, {}, s", name),
                      ms_since(begin) / 1000);
    process.signal(SIGTERM);
    static_cast<void>(process.wait(kLimit));
  }
}

/// Four servers, each job of another cell.
void measure_claims(const test::Postgres& database, const std::string& url) {
  constexpr int kServers = 4, kOfEach = 250;
  const std::int64_t first = std::stoll(database.sql(
      url, fmt::format("WITH made AS (INSERT INTO jobs (cell, level, bias, state, message, "
                       "created_at) SELECT 'claimed-' || c, '', '', 'queued', '', 0 FROM "
                       "generate_series(1, {}) AS c RETURNING id) SELECT MIN(id) FROM made",
                       kServers * kOfEach)));
  std::vector<std::unique_ptr<Store>> stores;
  for (int i = 0; i < kServers; ++i) {
    stores.push_back(demand(Store::open(url)));
    stores.back()->works_as(fmt::format("server-{}", i));
  }
  const auto begin = Clock::now();
  {
    std::vector<std::jthread> threads;
    for (int i = 0; i < kServers; ++i)
      threads.emplace_back([&, i] {
        for (std::int64_t job = first + i; job < first + kServers * kOfEach; job += kServers)
          demand_done(stores[static_cast<std::size_t>(i)]->set_job_running(job));
      });
  }
  test::tell_figure("shared store: claims a second, four servers",
                    kServers * kOfEach / (ms_since(begin) / 1000));
  std::vector<double> times;
  for (int i = 0; i < 21; ++i) {
    const auto look = Clock::now();
    static_cast<void>(demand(stores.front()->jobs_to_take()));
    times.push_back(ms_since(look));
  }
  test::tell_figure("shared store: which jobs of 1,000 may be taken, median, ms",
                    quantile(times, 0.5));
  database.sql(url, "UPDATE jobs SET state = 'failed' WHERE state IN ('queued', 'running')");
}

void measure_serving(const std::string& url) {
  test::Daemon first(0), second(1);
  for (test::Daemon* daemon : {&first, &second}) {
    configure(*daemon, url, "");
    daemon->start();
  }
  const auto one = demand(client::Session::open(first.session_options()));
  const auto other = demand(client::Session::open(second.session_options()));
  for (const std::uint64_t seed : {1, 2}) {
    const auto job = demand(one->submit_measurements(kServed, fmt::format("b{}", seed),
                                                     test::virtual_batch_csv(60, seed)));
    static_cast<void>(demand(one->wait_for_job(job, kLimit, nullptr)));
  }
  client::CallContext context;
  context.cell = kServed;
  client::ChangeOptions forced;
  forced.force = true;
  std::vector<double> times;
  const auto joints = test::virtual_joints(1, 7);
  for (int i = 0; i < 101; ++i) {
    const int version = demand(other->predict_error(context, joints)).model.version == 1 ? 2 : 1;
    static_cast<void>(demand(one->activate(kServed, version, forced)));
    const auto begin = Clock::now();
    while (demand(other->predict_error(context, joints)).model.version != version &&
           ms_since(begin) < 10'000) {
    }
    times.push_back(ms_since(begin));
  }
  test::tell_figure("shared store: put in force on one server until another serves it, median, ms",
                    quantile(times, 0.5));
  test::tell_figure("shared store: put in force on one server until another serves it, longest, ms",
                    quantile(times, 1));
}

}  // namespace
}  // namespace trammel

int main(int argc, char** argv) {
  using namespace trammel;
  std::string only;
  int batches = 500'000;
  CLI::App app("What a PostgreSQL of the same host costs.");
  app.add_option("--only", only)
      ->check(CLI::IsMember({"accept", "list", "ready", "claims", "served"}));
  app.add_option("--batches", batches)->check(CLI::Range(0, 10'000'000));
  CLI11_PARSE(app, argc, argv);
  test::Postgres database(test::Postgres::Disk::kWaitedFor);
  const std::string url = database.new_store();
  fill(database, url, batches);
  const auto wants = [&only](const char* part) { return only.empty() || only == part; };
  if (wants("accept")) measure_accepting(url);
  if (wants("accept")) measure_accepting_by_service(url);
  if (wants("list")) measure_listing(url);
  if (wants("claims")) measure_claims(database, url);
  if (wants("served")) measure_serving(url);
  if (wants("ready")) measure_start(url);
}
