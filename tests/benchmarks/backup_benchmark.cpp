// The cost of a backup of a large store for those who ask: one client corrects one target after the
// other, a hundred a second, without and while `trammel backup` copies the store.
// --mb N (of the store), --rounds N.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <random>

#include "clients/session/session.h"
#include "server/base/hash.h"
#include "server/store/store.h"
#include "tests/support/daemon.h"
#include "tests/support/demand.h"
#include "tests/support/figure.h"
#include "tests/support/virtual_cell.h"

namespace trammel {
namespace {

using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr std::size_t kBatch = 30'000'000;  // bytes
constexpr milliseconds kPeriod{10};         // of asking
constexpr seconds kAlone{10}, kLimit{300};

/// Digits that no file system makes small.
std::string digits(std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::string text;
  while (text.size() < kBatch) text += std::to_string(random());
  return text;
}

/// Batches that nothing learns from.
void fill(const std::string& path, int mb) {
  const auto store = test::demand(Store::open(path));
  for (int i = 0; static_cast<std::size_t>(i) * kBatch < static_cast<std::size_t>(mb) * 1'000'000;
       ++i) {
    const std::string id = "large-" + std::to_string(i),
                      text = digits(static_cast<std::uint64_t>(i));
    StoredJob job;
    job.cell = "cell-7";
    job.batch_ids = {id};
    job.created_at = 1700000000;
    job = test::demand(store->add_batch(
        {"cell-7", id, text, sha256_hex(text), "client:" + id, 1700000000, 1}, job));
    if (const Status failed = store->set_job_failed(job.id, "not asked for"); !failed)
      static_cast<void>(test::demand(Result<int>(tl::make_unexpected(failed.error()))));
  }
}

void learn(client::Session& session) {
  const auto job =
      test::demand(session.submit_measurements("cell-7", "first", test::virtual_batch_csv(150, 3)));
  const auto ended =
      test::demand(session.wait_for_job(job, kLimit, [](const client::JobStatus&) {}));
  if (!ended.in_force) fmt::print(stderr, "{}\n", ended.why);
}

struct Asked {
  std::vector<double> ms;
  int lost = 0;
};

/// `over` waits for a period.
template <typename Over>
Asked ask(client::Session& session, const Over& over) {
  client::CallContext context;
  context.cell = "cell-7";
  exchange::AskedTarget target;
  target.pose = {1800, 125, 1200, 0.7071067811865476, 0, 0.7071067811865476, 0};
  target.conf = 0;
  Asked asked;
  while (!over()) {
    const auto began = Clock::now();
    if (!session.correct_targets(context, {target})) ++asked.lost;
    asked.ms.push_back(std::chrono::duration<double, std::milli>(Clock::now() - began).count());
  }
  std::sort(asked.ms.begin(), asked.ms.end());
  return asked;
}

double at(const Asked& asked, double share) {
  return asked.ms[static_cast<std::size_t>(share * static_cast<double>(asked.ms.size() - 1))];
}

void compare(client::Session& session, test::Daemon& daemon, int rounds) {
  const test::TemporaryFolder folder;
  std::vector<double> ratios;
  int lost = 0;
  for (int round = 0; round < rounds; ++round) {
    const auto until = Clock::now() + kAlone;
    const Asked alone = ask(session, [&] {
      return daemon.process().wait(kPeriod).has_value() || Clock::now() > until;
    });
    const auto began = Clock::now();
    test::Process copying({TRAMMEL_BINARY_DIR "/clients/trammel", "backup", "--store",
                           daemon.store_path(), "-o",
                           folder.file("copy-" + std::to_string(round))});
    const Asked beside = ask(session, [&] { return copying.wait(kPeriod).has_value(); });
    fmt::print(
        "one target: p50 {:.2f}, p99 {:.2f} ms; while the store was copied, {:.0f} s: p50 {:.2f}, "
        "p99 {:.2f} ms\n",
        at(alone, 0.5), at(alone, 0.99),
        std::chrono::duration<double>(Clock::now() - began).count(), at(beside, 0.5),
        at(beside, 0.99));
    if (copying.wait(kLimit) != 0) fmt::print(stderr, "{}\n", copying.standard_error());
    ratios.push_back(at(beside, 0.99) / at(alone, 0.99));
    lost += alone.lost + beside.lost;
  }
  std::sort(ratios.begin(), ratios.end());
  test::tell_figure("backup: p99 of one target over that without", ratios[ratios.size() / 2]);
  test::tell_figure("backup: requests without an answer", lost);
}

}  // namespace
}  // namespace trammel

int main(int argc, char** argv) {
  CLI::App app("What a backup of a large store costs those who ask.");
  int mb = 1000, rounds = 3;
  app.add_option("--mb", mb);
  app.add_option("--rounds", rounds);
  CLI11_PARSE(app, argc, argv);
  trammel::test::Daemon daemon;
  trammel::fill(daemon.store_path(), mb);
  daemon.start();
  const auto session =
      trammel::test::demand(trammel::client::Session::open(daemon.session_options()));
  trammel::learn(*session);
  trammel::compare(*session, daemon, rounds);
  return 0;
}
