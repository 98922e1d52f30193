// Two servers and a training host with one PostgreSQL, all of which are killed (SIGKILL) or stopped
// (SIGSTOP) while four clients submit, train, activate, roll back, release, discard and read, and
// two more ask for predictions. What they asked and were answered is checked by
// tests/faults/history/history_check.py.
// --kills N, --seed N, --jobs-s N, --history FILE to keep it.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <iostream>

#include "tests/support/figure.h"
#include "tests/support/killed_fleet.h"
#include "tests/support/temporary_folder.h"

namespace trammel {
namespace {

void tell_times(const std::string& what, std::vector<double> times) {
  if (times.empty()) return;
  std::sort(times.begin(), times.end());
  test::tell_figure(fmt::format("kills: writes again after {}, median, s", what),
                    times[times.size() / 2]);
  test::tell_figure(fmt::format("kills: writes again after {}, longest, s", what), times.back());
}

int measure(const test::KillPlan& plan, const std::string& history) {
  const auto begin = std::chrono::steady_clock::now();
  const test::KilledFleetOutcome outcome = test::kill_a_fleet(plan, history);
  test::tell_figure(
      "kills: the whole run, s",
      std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count());
  int kills = 0;
  for (const auto& [what, count] : outcome.kills) {
    kills += count;
    std::cout << fmt::format("{}: {}", what, count) << std::endl;
  }
  const test::Finished checked = test::check_history(history);
  std::cout << checked.out << checked.err << std::flush;
  test::tell_figure("kills: kills", kills);
  test::tell_figure("kills: jobs", outcome.jobs);
  test::tell_figure("kills: jobs that waited when the last kill was over", outcome.left_over);
  test::tell_figure("kills: jobs that have not ended", outcome.open);
  test::tell_figure("kills: from the last kill until all jobs had ended, s", outcome.jobs_ended_s);
  test::tell_figure("kills: jobs of a cell wait and nobody works for it, longest, s",
                    outcome.longest_idle_s);
  test::tell_figure("kills: jobs of a cell wait and nobody works for it, sum, s", outcome.idle_s);
  test::tell_figure("kills: jobs that three servers died of", outcome.given_up);
  test::tell_figure("kills: predictions while servers were killed", outcome.predictions);
  test::tell_figure("kills: predictions that failed", outcome.failed);
  test::tell_figure("kills: servers that ended by themselves", outcome.ended_by_themselves);
  test::tell_figure("kills: audit trail broken", outcome.trail_whole ? 0 : 1);
  test::tell_figure("kills: cells served otherwise than is in force", outcome.served_otherwise);
  test::tell_figure("kills: p99 of a prediction in a quiet fleet, ms", outcome.p99_quiet_ms);
  test::tell_figure("kills: p99 of a prediction under load, ms", outcome.p99_load_ms);
  test::tell_figure("kills: p99 of a prediction under load and kills, ms", outcome.p99_kills_ms);
  test::tell_figure("kills: p99 over that of a quiet fleet",
                    outcome.p99_kills_ms / outcome.p99_quiet_ms);
  test::tell_figure("kills: p99 over that without kills",
                    outcome.p99_kills_ms / outcome.p99_load_ms);
  tell_times("the loss of the database", outcome.after_database_s);
  tell_times("the database is back", outcome.after_ready_s);
  tell_times("the loss of a server", outcome.after_server_s);
  const bool good = checked.exit_code == 0 && outcome.trail_whole && outcome.served_otherwise == 0;
  return good ? 0 : 1;
}

}  // namespace
}  // namespace trammel

int main(int argc, char** argv) {
  trammel::test::KillPlan plan;
  std::string history;
  const trammel::test::TemporaryFolder folder;
  CLI::App app("A fleet whose database, servers and computing processes are killed under load");
  app.add_option("--kills", plan.kills)->check(CLI::Range(1, 10000));
  app.add_option("--seed", plan.seed);
  app.add_option("--history", history);
  int jobs_s = static_cast<int>(plan.until_jobs_end.count());
  app.add_option("--jobs-s", jobs_s, "How long jobs may take to end after the last kill")
      ->check(CLI::Range(1, 86400));
  CLI11_PARSE(app, argc, argv);
  plan.until_jobs_end = std::chrono::seconds(jobs_s);
  return trammel::measure(plan, history.empty() ? folder.file("history.jsonl") : history);
}
