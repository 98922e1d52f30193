#pragma once

#include <string>
#include <vector>

#include "server/store/database/database.h"

/// The failures that a committed change in PostgreSQL survives, given its settings and the present
/// standbys.
namespace trammel {

struct CommitSettings {
  bool fsync = true;
  std::string synchronous_commit = "on";
  std::string standby_names;            ///< synchronous_standby_names
  bool standbys_are_seen = true;        ///< false: this role may not see them
  int standbys = 0;                     ///< the streaming ones
  std::vector<std::string> waited_for;  ///< the standbys for which a commit waits, or may wait
};

struct CommitSafety {
  std::string survives;  ///< ends the sentence `an acknowledged change survives ...`
  std::string worry;     ///< the defect and its repair; empty: none
};

[[nodiscard]] CommitSafety safety_of(const CommitSettings& settings);
/// The settings of this connection. Throws DatabaseError.
[[nodiscard]] CommitSettings commit_settings(Database& database);

/// The advice if Patroni runs on this host without a watchdog that would stop it when it hangs.
/// Else empty.
[[nodiscard]] std::string missing_watchdog(const std::string& proc = "/proc",
                                           const std::string& sys = "/sys");

}  // namespace trammel
