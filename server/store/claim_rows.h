#pragma once

#include <chrono>
#include <cstdint>
#include <string>

#include "server/store/database/database.h"
#include "server/store/servers.h"

/// Who works on a job, for the transactions of jobs and models.
namespace trammel {

/// For so long a server is believed to live that has not been heard of: what it works on is taken
/// up by another one within 20 s of its end.
constexpr std::chrono::seconds kLease = kGoneAfter;

/// Whoever works on jobs through one connection.
struct Worker {
  std::string server;  ///< as people know it
  std::string token;   ///< of this start of it: what a start before claimed is not its own
};

/// Times of claims and servers are the database's: servers have clocks of their own. Unix time, s.
/// As an expression, where it is to be of the statement itself.
[[nodiscard]] const char* now_in(const Database& database);
[[nodiscard]] std::int64_t now_of(Database& database);

/// For the RETURNING of what is written again soon: the commit then waits neither for the disk nor
/// for a standby.
[[nodiscard]] const char* unwaited_for(const Database& database);

/// Servers hear at the end of the transaction that there may be something to do: at once, and not
/// by looking.
void tell_others(Database& database);

/// Has a token of its own, and no name.
[[nodiscard]] Worker new_worker();

/// Sets the job running, claims it for the worker and counts an attempt. Refuses (kNotFound) one
/// that is over, (kConflict) one of a cell that another server works for.
[[nodiscard]] Status claim_job(Database& database, const Worker& worker, std::int64_t job);
/// Refuses (kNotFound) a running job that another worker has claimed, also where that one is dead.
/// `also_waiting`: for results, which only the last worker has: one that put the job back, too.
[[nodiscard]] Status check_held(Database& database, const Worker& worker, std::int64_t job,
                                bool also_waiting = false);

}  // namespace trammel
