#pragma once

#include <string>
#include <vector>

#include "server/store/database/database.h"

/// The safety of a change that PostgreSQL has committed: what it survives, by its settings and the
/// standbys that are there.
namespace trammel {

struct CommitSettings {
  bool fsync = true;
  std::string synchronous_commit = "on";
  std::string standby_names;            ///< synchronous_standby_names
  bool standbys_are_seen = true;        ///< false: this role may not see them
  int standbys = 0;                     ///< that stream
  std::vector<std::string> waited_for;  ///< those of them that a commit waits for, or may
};

struct CommitSafety {
  std::string survives;  ///< ends the sentence `an acknowledged change survives ...`
  std::string worry;     ///< what is not as it should be, and what to do about it; empty: nothing
};

[[nodiscard]] CommitSafety safety_of(const CommitSettings& settings);
/// By this connection's settings. Throws DatabaseError.
[[nodiscard]] CommitSettings commit_settings(Database& database);

/// Where Patroni runs on this host, and no watchdog would stop it if it hung: what to do about it.
/// Else empty.
[[nodiscard]] std::string missing_watchdog(const std::string& proc = "/proc",
                                           const std::string& sys = "/sys");

}  // namespace trammel
