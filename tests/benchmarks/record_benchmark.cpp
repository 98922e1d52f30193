// Cost of recording for those who ask: two servers of the same model, one records what it answers.
// One client asks both in turn, for one target and for many; and how much disk a request takes.
// --requests N (of one target, a round), --rounds N.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <chrono>
#include <filesystem>
#include <fstream>

#include "clients/session/session.h"
#include "server/base/text_file.h"
#include "tests/support/daemon.h"
#include "tests/support/demand.h"
#include "tests/support/figure.h"
#include "tests/support/virtual_cell.h"

namespace trammel {
namespace {

using Clock = std::chrono::steady_clock;
constexpr std::chrono::seconds kLimit{300};
constexpr std::size_t kMany = 5000;

/// A server with a model, and a client of its own.
struct Served {
  explicit Served(int number, bool records) : daemon(number) {
    const std::string text = test::read_file(daemon.config_path());
    const std::string more = records ? "record: {folder: records, max_mb: 1000}\n" : "";
    static_cast<void>(
        test::demand(write_text_file(daemon.config_path(), text + more).map([] { return true; })));
    daemon.start();
    session = test::demand(client::Session::open(daemon.session_options()));
    const auto job = test::demand(
        session->submit_measurements("cell-7", "first", test::virtual_batch_csv(150, 3)));
    static_cast<void>(test::demand(session->wait_for_job(job, kLimit, nullptr)));
  }

  test::Daemon daemon;
  std::unique_ptr<client::Session> session;
};

exchange::AskedTarget hole(std::size_t i) {
  exchange::AskedTarget target;
  target.pose = {
      1800, 125 - 0.02 * static_cast<double>(i), 1200, 0.7071067811865476, 0, 0.7071067811865476,
      0};
  target.conf = 0;
  return target;
}

double milliseconds_of(client::Session& session,
                       const std::vector<exchange::AskedTarget>& targets) {
  client::CallContext context;
  context.cell = "cell-7";
  const auto began = Clock::now();
  static_cast<void>(test::demand(session.correct_targets(context, targets)));
  return std::chrono::duration<double, std::milli>(Clock::now() - began).count();
}

double at(std::vector<double>& sorted, double share) {
  std::sort(sorted.begin(), sorted.end());
  return sorted[static_cast<std::size_t>(share * static_cast<double>(sorted.size() - 1))];
}

/// With recording over without, of the same share of the requests.
double ratio(std::array<std::vector<double>, 2>& times, double share) {
  return at(times[1], share) / at(times[0], share);
}

void tell_one(std::array<Served*, 2> servers, int requests, int rounds) {
  std::vector<double> p50, p99;
  for (int round = 0; round < rounds; ++round) {
    std::array<std::vector<double>, 2> times;
    for (int i = 0; i < requests; ++i)
      for (std::size_t k = 0; k < 2; ++k)
        times.at(k).push_back(
            milliseconds_of(*servers.at(k)->session, {hole(static_cast<std::size_t>(i) % kMany)}));
    p50.push_back(ratio(times, 0.5));
    p99.push_back(ratio(times, 0.99));
    fmt::print("one target: p50 {:.3f}, p99 {:.3f} ms; recorded: p50 {:.3f}, p99 {:.3f} ms\n",
               at(times[0], 0.5), at(times[0], 0.99), at(times[1], 0.5), at(times[1], 0.99));
  }
  test::tell_figure("recording: p50 of one target over that without", at(p50, 0.5));
  test::tell_figure("recording: p99 of one target over that without", at(p99, 0.5));
}

void tell_many(std::array<Served*, 2> servers, int rounds) {
  std::vector<exchange::AskedTarget> targets;
  for (std::size_t i = 0; i < kMany; ++i) targets.push_back(hole(i));
  std::array<std::vector<double>, 2> times;
  for (int i = 0; i < 3 * rounds; ++i)
    for (std::size_t k = 0; k < 2; ++k)
      times.at(k).push_back(milliseconds_of(*servers.at(k)->session, targets));
  fmt::print("{} targets: p50 {:.0f} ms; recorded: p50 {:.0f} ms\n", kMany, at(times[0], 0.5),
             at(times[1], 0.5));
  test::tell_figure("recording: p50 of 5000 targets over that without", ratio(times, 0.5));
}

/// Bytes of a target on the disk, and how many requests of one target are in no record.
void tell_disk(Served& recorded, double asked) {
  const auto folder =
      std::filesystem::path(recorded.daemon.config_path()).parent_path() / "records";
  recorded.session.reset();
  static_cast<void>(recorded.daemon.stop());  // what waits is written first
  std::vector<double> bytes;
  for (const auto& file : std::filesystem::directory_iterator(folder)) {
    std::ifstream in(file.path());
    for (std::string line; std::getline(in, line);)
      bytes.push_back(static_cast<double>(line.size()));
  }
  const double one = at(bytes, 0);
  const auto lines =
      std::count_if(bytes.begin(), bytes.end(), [&](double size) { return size < 2 * one; });
  test::tell_figure("recording: requests of one target in no record",
                    asked - static_cast<double>(lines));
  test::tell_figure("recording: bytes of one target", one);
}

}  // namespace
}  // namespace trammel

int main(int argc, char** argv) {
  CLI::App app("What recording costs those who ask.");
  int requests = 2000, rounds = 3;
  app.add_option("--requests", requests);
  app.add_option("--rounds", rounds);
  CLI11_PARSE(app, argc, argv);
  trammel::Served plain(0, false), recorded(1, true);
  trammel::tell_one({&plain, &recorded}, requests, rounds);
  trammel::tell_many({&plain, &recorded}, rounds);
  trammel::tell_disk(recorded, requests * rounds);
  return 0;
}
