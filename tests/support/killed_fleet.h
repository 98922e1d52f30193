#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "tests/support/daemon.h"
#include "tests/support/fleet_client.h"
#include "tests/support/postgres.h"

/// A database, two servers and a training host that are killed and stopped under load.
namespace trammel::test {

struct KillPlan {
  int kills = 200;
  std::uint64_t seed = 1;
  std::chrono::milliseconds longest_pause{2500};  ///< between two kills
  std::chrono::seconds quiet{10};  ///< duration of the measurements without load, and with load
                                   ///< alone
  int batches = 40;                ///< of a cell, at most
  std::chrono::seconds until_jobs_end{300};  ///< after the last kill
};

struct KilledFleetOutcome {
  std::map<std::string, int> kills;  ///< by the kind of process that was killed or stopped
  int predictions = 0, failed = 0;   ///< while there were kills
  double p99_quiet_ms = 0, p99_load_ms = 0, p99_kills_ms = 0;
  std::vector<double> after_database_s,
      after_server_s;                 ///< from the loss until a change was acknowledged again
  std::vector<double> after_ready_s;  ///< from when the database was back
  int given_up = 0;                   ///< jobs that three servers died of
  int jobs = 0;                       ///< all that there were
  int left_over = 0;                  ///< jobs that still waited after the last kill
  int open = 0;                       ///< jobs that did not end in their time
  double jobs_ended_s = 0;            ///< from the last kill until all had ended
  /// Since then: how long jobs of a cell waited that nobody worked for, the longest time and the
  /// sum, of the worst cell.
  double longest_idle_s = 0, idle_s = 0;
  int served_otherwise = 0;     ///< servers that at the end do not serve the version in force
  int ended_by_themselves = 0;  ///< servers that ended though nobody killed them
  bool trail_whole = false;
};

/// Runs the plan, writes the history to that file, and returns further figures.
[[nodiscard]] KilledFleetOutcome kill_a_fleet(const KillPlan& plan, const std::string& history);

/// The output of history_check.py for it, and its exit code.
[[nodiscard]] Finished check_history(const std::string& history);

}  // namespace trammel::test
