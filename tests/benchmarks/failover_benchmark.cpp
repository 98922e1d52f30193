// The time without changes when the host of the record's primary is killed, frozen or cut off,
// and whether anything that was acknowledged is lost: a PostgreSQL of three hosts under Patroni
// (deploy/patroni), two servers, clients that change something all the time. Needs root. --rounds N
// (of each fault), --clients N, --faults kill,freeze,cut,mute,deaf.
#include <CLI/CLI.hpp>
#include <algorithm>

#include "tests/support/failing_over.h"
#include "tests/support/figure.h"

namespace trammel {
namespace {

constexpr std::chrono::seconds kLimit{300};

const char* remedy_of(const std::string& fault) {
  return fault == "kill" ? "start" : fault == "freeze" ? "thaw" : "mend";
}

int measure(const std::vector<std::string>& faults, int rounds, int clients) {
  test::FailingOver fleet;
  if (!fleet.why_not().empty()) {
    fmt::print(stderr, "{}\n", fleet.why_not());
    return 1;
  }
  test::ChangeLoad load(fleet.session_options(), clients);
  std::vector<double> pauses;
  for (int round = 0; round < rounds; ++round) {
    for (const std::string& fault : faults) {
      if (!fleet.record.wait_until_whole() || !load.wait_for_everybody(kLimit)) return 1;
      const int primary = fleet.record.primary();
      const auto since = test::ChangeLoad::Clock::now();
      fleet.record.act(fault, primary);
      if (!load.wait_for_everybody(kLimit)) return 1;
      pauses.push_back(load.longest_pause_s(since));
      fmt::print("{} host {}: {:.1f} s, now host {} takes changes\n", fault, primary, pauses.back(),
                 fleet.record.primary());
      std::fflush(stdout);
      fleet.record.act(remedy_of(fault), primary);
    }
  }
  if (!fleet.record.wait_until_whole() || !load.wait_for_everybody(kLimit)) return 1;
  load.stop();
  std::sort(pauses.begin(), pauses.end());
  const auto lost = fleet.lost(load);
  fmt::print("{}", fleet.twice());
  for (const std::string& id : lost) fmt::print("lost: {}\n", id);
  test::tell_figure("failover: median until changes are taken again, s", pauses[pauses.size() / 2]);
  test::tell_figure("failover: longest until changes are taken again, s", pauses.back());
  test::tell_figure("failover: changes acknowledged", static_cast<double>(load.acknowledged()));
  test::tell_figure("failover: acknowledged and lost", static_cast<double>(lost.size()));
  test::tell_figure("failover: made twice", fleet.twice().empty() ? 0 : 1);
  test::tell_figure("failover: put in force on one server until another serves it, s",
                    fleet.until_served_elsewhere_s());
  return 0;
}

}  // namespace
}  // namespace trammel

int main(int argc, char** argv) {
  CLI::App app("Faults of a record that fails over");
  std::vector<std::string> faults = {"kill", "freeze", "cut", "mute", "deaf"};
  int rounds = 2, clients = 4;
  app.add_option("--faults", faults, "kill, freeze, cut")->delimiter(',');
  app.add_option("--rounds", rounds)->check(CLI::Range(1, 1000));
  app.add_option("--clients", clients)->check(CLI::Range(1, 64));
  CLI11_PARSE(app, argc, argv);
  return trammel::measure(faults, rounds, clients);
}
