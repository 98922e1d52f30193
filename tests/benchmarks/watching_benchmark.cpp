// The cost of being watched: a scrape of a server of many cells over HTTP, and what counting
// costs each request.
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <vector>

#include "server/http/http_server.h"
#include "server/metrics/operation_counts.h"
#include "tests/support/demand.h"
#include "tests/support/http_client.h"
#include "tests/support/own_ports.h"
#include "tests/support/small_cell.h"
#include "tests/support/temporary_folder.h"

namespace trammel {
namespace {

using Clock = std::chrono::steady_clock;
using test::demand;

constexpr int kCells = 200;
constexpr int kScrapes = 50;

/// Processor time of this process, all threads: on a crowded machine the clock tells of others.
double processor_ms() {
  timespec used{};
  ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &used);
  return 1e3 * static_cast<double>(used.tv_sec) + 1e-6 * static_cast<double>(used.tv_nsec);
}

ServedCells cells() {
  ServedCells cells;
  for (int i = 0; i < kCells; ++i) {
    const std::string name = fmt::format("cell-{:03}", i);
    cells[name] = test::small_cell(name);
  }
  return cells;
}

/// As many operations and codes as a service has.
ServiceFigures figures() {
  ServiceFigures figures;
  const LatencyHistogram none;
  for (int i = 0; i < 9; ++i)
    figures.operations.push_back(
        {fmt::format("Operation{}", i), none.counts(), {{"ok", 1}, {"busy", 2}, {"refused", 3}}});
  figures.queues = {{"predictions", 0}, {"corrections", 0}, {"reads", 0}, {"changes", 0}};
  for (int i = 0; i < 16; ++i) figures.dropped_packets[fmt::format("reason {}", i)] = 0;
  return figures;
}

void print_times(const char* what, std::vector<double> times) {
  std::sort(times.begin(), times.end());
  fmt::print("figure {}: {:.2f}\n", what, times[times.size() / 2]);
}

void scrape() {
  const test::TemporaryFolder folder;
  const auto store = demand(Store::open(folder.file("t.db")));
  ModelRegistry registry;
  const ServedCells served = cells();
  Trainer trainer(served, *store, registry, {});
  for (const auto& [name, cell] : served)
    registry.publish(
        std::make_shared<const ServedModel>(ServedModel{name, 1, test::nominal_model(cell, 40)}));
  const auto port = test::own_ports();
  HttpServer http({"127.0.0.1", port}, {"server-a", "0.1.0", folder.file("t.db"), trainer, *store,
                                        registry, figures, [] {
                                          return Movement{true, {}};
                                        }});
  static_cast<void>(demand(http.start().map([] { return true; })));
  http.set_phase(ServerPhase::kServing);
  for (const char* path : {"/metrics", "/readyz", "/healthz"}) {
    std::vector<double> times, computing;
    std::size_t bytes = 0;
    for (int i = 0; i < kScrapes; ++i) {
      const auto began = Clock::now();
      const double processor = processor_ms();
      bytes = test::http_get(port, path).body.size();
      computing.push_back(processor_ms() - processor);
      times.push_back(std::chrono::duration<double, std::milli>(Clock::now() - began).count());
    }
    print_times(fmt::format("{} of {} cells, processor ms", path, kCells).c_str(), computing);
    print_times(fmt::format("{} of {} cells, ms", path, kCells).c_str(), times);
    fmt::print("{}: {} bytes\n", path, bytes);
  }
}

void count() {
  constexpr int kTimes = 2'000'000;
  OperationCounts counts;
  const double began = processor_ms();
  for (int i = 0; i < kTimes; ++i) {
    counts.answered(static_cast<std::size_t>(i % 2), 1);
    counts.took(std::chrono::nanoseconds(1000 * (i % 4096)));
  }
  fmt::print("figure counting one request, ns: {:.1f}\n", 1e6 * (processor_ms() - began) / kTimes);
}

}  // namespace
}  // namespace trammel

int main() {
  trammel::scrape();
  trammel::count();
}
