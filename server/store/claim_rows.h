#pragma once

#include <chrono>
#include <cstdint>
#include <string>

#include "server/store/database/database.h"
#include "server/store/servers.h"

/// The claims on jobs, for the transactions of jobs and models.
namespace trammel {

/// A server that was not heard of counts as alive for this long. After its end, another one takes
/// up its work within 20 s.
constexpr std::chrono::seconds kLease = kGoneAfter;

/// A server that works on jobs through one connection.
struct Worker {
  std::string server;  ///< its name for people
  std::string token;   ///< of this start of the server: claims of an earlier start are not its own
};

/// The expression for the present time in the database's clock, which dates claims and servers,
/// since each server has its own clock. Unix time, s. It is an expression because the time must be
/// that of the statement itself.
[[nodiscard]] const char* now_in(const Database& database);
[[nodiscard]] std::int64_t now_of(Database& database);

/// For the RETURNING clause of data that are soon written again: the commit then waits neither for
/// the disk nor for a standby.
[[nodiscard]] const char* unwaited_for(const Database& database);

/// Servers hear at the end of the transaction that there may be something to do: at once, and not
/// by looking.
void tell_others(Database& database);

/// Has a token of its own, and no name.
[[nodiscard]] Worker new_worker();

/// Sets the job running, claims it for the worker and counts an attempt. Refuses (kNotFound) a
/// finished job, and (kConflict) a job of a cell on which another server works.
[[nodiscard]] Status claim_job(Database& database, const Worker& worker, std::int64_t job);
/// Refuses (kNotFound) a running job that another worker has claimed, even if that worker is dead.
/// `also_waiting`: for results, also accepts a waiting job that this worker, its last one, put
/// back.
[[nodiscard]] Status check_held(Database& database, const Worker& worker, std::int64_t job,
                                bool also_waiting = false);

}  // namespace trammel
