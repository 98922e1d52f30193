#include <optional>
#include <random>

#include "server/store/audit_rows.h"
#include "server/store/cell_rows.h"
#include "server/store/changes.h"
#include "server/store/claim_rows.h"
#include "server/store/connection.h"
#include "server/store/job_rows.h"
#include "server/store/statements.h"
#include "server/store/store.h"

// A claim states which server works on a job, and until when others believe that this server lives.

namespace trammel {
namespace {

struct Claim {
  std::string server, token;
  std::int64_t lease_until = 0;  ///< Unix time, s
};

std::optional<Claim> claim_of(Database& database, std::int64_t job) {
  auto row =
      prepare(database, "SELECT server, token, lease_until FROM job_claims WHERE job = $1", job);
  if (!row.next()) return std::nullopt;
  return Claim{row.text(0), row.text(1), row.integer64(2)};
}

void lock_job(Database& database, std::int64_t job) {
  if (database.is_shared())
    static_cast<void>(exists(database, "SELECT 1 FROM jobs WHERE id = $1 FOR UPDATE", job));
}

Failure held_elsewhere(ErrorCode code, std::int64_t job, const std::string& server) {
  return failure(code, "job {} is worked on by {}", job, server).of("job").with_value(job);
}

/// Refuses if another live server works on the job, or on another job of its cell.
Status check_free(Database& database, const Worker& worker, const std::string& cell) {
  if (!database.is_shared()) return {};
  const std::string others = fmt::format(
      "SELECT job, server FROM job_claims JOIN jobs ON jobs.id = job_claims.job WHERE jobs.cell = "
      "$1 AND jobs.state = 'running' AND token <> $2 AND lease_until > {}",
      now_in(database));
  auto rows = prepare(database, others.c_str(), cell, worker.token);
  if (!rows.next()) return {};
  return held_elsewhere(ErrorCode::kConflict, rows.integer64(0), rows.text(1));
}

}  // namespace

const char* now_in(const Database& database) {
  return database.is_shared() ? "CAST(EXTRACT(EPOCH FROM clock_timestamp()) AS bigint)"
                              : "unixepoch()";
}

std::int64_t now_of(Database& database) {
  return integer_of(database, fmt::format("SELECT {}", now_in(database)).c_str());
}

const char* unwaited_for(const Database& database) {
  return database.is_shared() ? "set_config('synchronous_commit', 'off', TRUE)" : "1";
}

void tell_others(Database& database) {
  if (database.is_shared())
    static_cast<void>(exists(database, "SELECT pg_notify($1, '')", kChangesChannel));
}

Worker new_worker() {
  std::random_device random;
  return {"", fmt::format("{:08x}{:08x}{:08x}{:08x}", random(), random(), random(), random())};
}

Status check_held(Database& database, const Worker& worker, std::int64_t job, bool also_waiting) {
  if (!database.is_shared()) return {};  // no other process can hold a job of this file
  lock_job(database, job);
  const auto claim = claim_of(database, job);
  if (!claim || claim->token == worker.token) return {};
  const bool runs = exists(database, "SELECT 1 FROM jobs WHERE id = $1 AND state = 'running'", job);
  if (!runs && !also_waiting) return {};
  return held_elsewhere(ErrorCode::kNotFound, job, claim->server);
}

Status claim_job(Database& database, const Worker& worker, std::int64_t job) {
  const std::string cell = cell_of_job(database, job);
  lock_cell(database, cell);
  lock_job(database, job);
  TRY(check_free(database, worker, cell));
  const int begun = change(database,
                           "UPDATE jobs SET state = 'running', attempts = attempts + 1 WHERE id = "
                           "$1 AND state IN ('queued', 'running')",
                           job);
  if (begun != 1)
    return failure(ErrorCode::kNotFound, "job {} does not exist or is finished", job)
        .of("job")
        .with_value(job);
  const std::string claim = fmt::format(
      "INSERT INTO job_claims (job, server, token, lease_until, cancelled_by) VALUES ($1, $2, $3, "
      "{} + {}, NULL) ON CONFLICT (job) DO UPDATE SET server = excluded.server, token = "
      "excluded.token, lease_until = excluded.lease_until",
      now_in(database), kLease.count());
  change(database, claim.c_str(), job, worker.server, worker.token);
  return {};
}

bool Store::is_shared() const { return connection_->is_shared(); }

void Store::works_as(const std::string& server) { connection_->worker.server = server; }

void Store::wait_for_change(const std::stop_token& stop, std::chrono::milliseconds limit) {
  connection_->wait_for_change(stop, limit);
}

void Store::will_end() { connection_->will_end(); }

Result<ClaimState> Store::renew_claim(std::int64_t job) {
  return connection_->urgently([&](Database& database) -> Result<ClaimState> {
    const std::string renew = fmt::format(
        "UPDATE job_claims SET lease_until = {} + {} WHERE job = $1 AND token = $2 RETURNING "
        "cancelled_by, {}",
        now_in(database), kLease.count(), unwaited_for(database));
    auto row = prepare(database, renew.c_str(), job, connection_->worker.token);
    ClaimState state;
    state.is_held = row.next();
    if (state.is_held && !row.is_null(0)) state.cancelled_by = row.text(0);
    return state;
  });
}

Result<CancelledJob> Store::cancel_job(std::int64_t job, const JobOutcome& outcome,
                                       const ChangeId& by) {
  const auto cancel = [&](Database& database) -> Result<ChangeOutcome> {
    lock_job(database, job);
    const bool waits =
        exists(database, "SELECT 1 FROM jobs WHERE id = $1 AND state = 'queued'", job);
    const bool runs =
        exists(database, "SELECT 1 FROM jobs WHERE id = $1 AND state = 'running'", job);
    if (!waits && !runs)
      return failure(ErrorCode::kConflict, "job {} is over", job).of("job").with_value(job);
    const int heard =
        waits
            ? 0
            : change(database,
                     "UPDATE job_claims SET cancelled_by = $1 WHERE job = $2 AND lease_until > $3",
                     by.who, job, now_of(database));
    // No live worker has the job.
    if (heard == 0) static_cast<void>(fail_job(database, job, outcome.why, outcome, by));
    tell_others(database);
    return ChangeOutcome{0, job};
  };
  return connection_->in_transaction([&](Database& database) -> Result<CancelledJob> {
    TRY(once(database, cell_of_job(database, job), by,
             [&]() -> Result<ChangeOutcome> { return cancel(database); }));
    const bool runs =
        exists(database, "SELECT 1 FROM jobs WHERE id = $1 AND state = 'running'", job);
    return runs ? CancelledJob::kAsked : CancelledJob::kEnded;
  });
}

Result<std::map<std::int64_t, std::string>> Store::jobs_to_take() const {
  return connection_->exclusively(
      [&](Database& database) -> Result<std::map<std::int64_t, std::string>> {
        // The few jobs in work are looked up once, and not for each waiting job.
        const std::string to_take = fmt::format(
            "WITH alive AS (SELECT id, cell, token FROM jobs JOIN job_claims ON job = id WHERE "
            "state = 'running' AND lease_until > {}) SELECT id, cell FROM jobs WHERE state IN "
            "('queued', 'running') AND id NOT IN (SELECT id FROM alive) AND cell NOT IN (SELECT "
            "cell FROM alive WHERE token <> $1)",
            now_in(database));
        auto rows = prepare(database, to_take.c_str(), connection_->worker.token);
        std::map<std::int64_t, std::string> jobs;
        while (rows.next()) jobs.emplace(rows.integer64(0), rows.text(1));
        return jobs;
      });
}

Result<std::set<std::string>> Store::cells_changed_after(std::int64_t changes) const {
  return connection_->exclusively([&](Database& database) -> Result<std::set<std::string>> {
    auto rows = prepare(database, "SELECT DISTINCT cell FROM audit WHERE number > $1", changes);
    std::set<std::string> cells;
    while (rows.next()) cells.insert(rows.text(0));
    return cells;
  });
}

}  // namespace trammel
