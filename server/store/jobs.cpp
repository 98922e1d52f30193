#include <algorithm>
#include <array>
#include <map>
#include <set>
#include <string_view>
#include <utility>

#include "server/base/units.h"
#include "server/base/unix_time.h"
#include "server/store/audit_rows.h"
#include "server/store/changes.h"
#include "server/store/connection.h"
#include "server/store/job_rows.h"
#include "server/store/pruned.h"
#include "server/store/store.h"

// Jobs: asked for, under way, over.

namespace trammel {
namespace {

constexpr std::array<std::pair<JobState, const char*>, 4> kJobStates = {
    {{JobState::kQueued, "queued"},
     {JobState::kRunning, "running"},
     {JobState::kDone, "done"},
     {JobState::kFailed, "failed"}}};

const char* to_text(JobState state) {
  for (const auto& [value, text] : kJobStates) {
    if (value == state) return text;
  }
  return "";
}

JobState job_state_of(std::string_view text) {
  for (const auto& [value, name] : kJobStates) {
    if (text == name) return value;
  }
  return JobState::kFailed;  // the schema's CHECK allows no other text
}

constexpr const char* kJobColumns =
    "SELECT id, cell, level, bias, state, message, created_at, model_version, attempts, CASE WHEN "
    "health_checks.job IS NULL THEN kind ELSE 'check' END, "
    "started_at, finished_at, verdict, before_m, after_m, limit_m, code, why, next_step, "
    "peak_bytes, processor_s, job_claims.server, held_back, tolerance_m, apply FROM jobs LEFT JOIN "
    "health_checks ON health_checks.job = jobs.id LEFT JOIN diagnoses ON diagnoses.job = jobs.id "
    "LEFT JOIN job_claims ON job_claims.job = "
    "jobs.id LEFT JOIN job_times ON job_times.job = jobs.id LEFT JOIN job_outcomes ON "
    "job_outcomes.job = jobs.id ";

/// The outcome in a row of kJobColumns.
JobOutcome outcome_of(Rows& row) {
  JobOutcome outcome;
  if (row.is_null(12)) return outcome;
  outcome.verdict = job_verdict_of(row.text(12)).value_or(JobVerdict::kOpen);
  outcome.before = optional_number(row, 13);
  outcome.after = optional_number(row, 14);
  outcome.limit = optional_number(row, 15);
  outcome.code = error_code_of(row.text(16));
  outcome.why = row.text(17);
  outcome.next = row.text(18);
  outcome.peak_memory = optional_integer(row, 19);
  outcome.processor_time = optional_number(row, 20);
  outcome.held_back = held_back_of(row.text(22));
  return outcome;
}

/// The request in a row of kJobColumns.
AskedJob asked_of(Rows& row) {
  const std::string kind = row.text(9);
  if (kind == "check") return AskedCheck{optional_number(row, 23)};
  if (kind == "diagnose") return AskedDiagnosis{!row.is_null(24) && row.truth(24)};
  return AskedTraining{row.text(2), row.text(3)};
}

/// The job in a row of kJobColumns, without its batches.
StoredJob job_of(Rows& row) {
  StoredJob job;
  job.id = row.integer64(0);
  job.cell = row.text(1);
  job.asked = asked_of(row);
  job.state = job_state_of(row.text(4));
  job.message = row.text(5);
  job.created_at = row.integer64(6);
  job.model_version = row.integer(7);
  job.attempts = row.integer(8);
  job.started_at = optional_integer(row, 10);
  job.finished_at = optional_integer(row, 11);
  job.outcome = outcome_of(row);
  if (job.state != JobState::kQueued) job.server = row.text(21);
  return job;
}

/// Adds the batch ids of all jobs by one statement.
void add_batch_ids(Database& database, std::vector<StoredJob>& jobs) {
  std::map<std::int64_t, StoredJob*> by_id;
  std::set<std::int64_t> ids;
  for (StoredJob& job : jobs) {
    by_id[job.id] = &job;
    ids.insert(job.id);
  }
  if (ids.empty()) return;
  const std::string wanted = fmt::format(
      "SELECT job, batch FROM job_batches WHERE job IN ({}) ORDER BY job, position", list_of(ids));
  auto rows = prepare(database, wanted.c_str());
  while (rows.next()) by_id.at(rows.integer64(0))->batch_ids.push_back(rows.text(1));
}

std::vector<StoredJob> jobs_of(Database& database, Rows rows) {
  std::vector<StoredJob> jobs;
  while (rows.next()) jobs.push_back(job_of(rows));
  add_batch_ids(database, jobs);
  return jobs;
}

void record_start(Database& database, std::int64_t job) {
  change(database,
         "INSERT INTO job_times (job, started_at) VALUES ($1, $2) ON CONFLICT (job) DO UPDATE SET "
         "started_at = excluded.started_at",
         job, unix_now());
}

void record_outcome(Database& database, std::int64_t job, const JobOutcome& outcome) {
  change(
      database,
      "INSERT INTO job_outcomes (job, verdict, before_m, after_m, limit_m, code, why, "
      "next_step, peak_bytes, processor_s, held_back) VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9, "
      "$10, $11) ON CONFLICT (job) DO UPDATE SET verdict = excluded.verdict, before_m = "
      "excluded.before_m, "
      "after_m = excluded.after_m, limit_m = excluded.limit_m, code = excluded.code, why = "
      "excluded.why, next_step = excluded.next_step, peak_bytes = excluded.peak_bytes, "
      "processor_s = excluded.processor_s, held_back = excluded.held_back",
      job, to_text(outcome.verdict), outcome.before, outcome.after, outcome.limit,
      outcome.code ? to_text(*outcome.code) : "", outcome.why, outcome.next, outcome.peak_memory,
      outcome.processor_time, to_text(outcome.held_back));
}

void record_end(Database& database, std::int64_t job, const JobOutcome& outcome) {
  change(database,
         "INSERT INTO job_times (job, finished_at) VALUES ($1, $2) ON CONFLICT (job) DO UPDATE SET "
         "finished_at = excluded.finished_at",
         job, unix_now());
  record_outcome(database, job, outcome);
}

}  // namespace

std::string list_of(const std::set<std::int64_t>& ids) {
  return fmt::format("{}", fmt::join(ids, ", "));
}

Status changed_one(int changes, std::int64_t id) {
  if (changes == 1) return {};
  return failure(ErrorCode::kNotFound, "job {} does not exist or is finished", id)
      .of("job")
      .with_value(id);
}

std::vector<std::string> batches_of_job(Database& database, std::int64_t job) {
  auto rows =
      prepare(database, "SELECT batch FROM job_batches WHERE job = $1 ORDER BY position", job);
  std::vector<std::string> ids;
  while (rows.next()) ids.push_back(rows.text(0));
  return ids;
}

AskedTraining training_of(const StoredJob& job) {
  const auto* training = std::get_if<AskedTraining>(&job.asked);
  return training != nullptr ? *training : AskedTraining{};
}

const char* stored_kind(JobKind kind) { return kind == JobKind::kTrain ? "train" : "diagnose"; }

std::int64_t insert_job(Database& database, const StoredJob& job) {
  const AskedTraining training = training_of(job);  // outlives the statement
  Rows made = prepare(database,
                      "INSERT INTO jobs (cell, level, bias, state, message, created_at, kind) "
                      "VALUES ($1, $2, $3, $4, $5, $6, $7) RETURNING id",
                      job.cell, training.level, training.bias, to_text(JobState::kQueued),
                      job.message, job.created_at, stored_kind(job.kind()));
  const std::int64_t id = made.next() ? made.integer64(0) : 0;
  if (const auto* check = std::get_if<AskedCheck>(&job.asked))
    change(database, "INSERT INTO health_checks (job, tolerance_m) VALUES ($1, $2)", id,
           check->tolerance);
  return id;
}

void insert_job_batches(Database& database, std::int64_t job, const std::string& cell,
                        const std::vector<std::string>& batch_ids) {
  int position = 0;
  for (const std::string& id : batch_ids) {
    change(database, "INSERT INTO job_batches (job, position, cell, batch) VALUES ($1, $2, $3, $4)",
           job, position++, cell, id);
  }
}

std::string cell_of_job(Database& database, std::int64_t job) {
  auto row = prepare(database, "SELECT cell FROM jobs WHERE id = $1", job);
  return row.next() ? row.text(0) : std::string();
}

Result<StoredJob> read_job(Database& database, std::int64_t id) {
  auto row = prepare(database, (std::string(kJobColumns) + "WHERE id = $1").c_str(), id);
  if (!row.next())
    return failure(ErrorCode::kNotFound, "job {} does not exist", id).of("job").with_value(id);
  StoredJob job = job_of(row);
  job.batch_ids = batches_of_job(database, id);
  return job;
}

Status end_job(Database& database, const Worker& worker, std::int64_t id, const std::string& cell,
               int model_version, const std::string& message, const JobOutcome& outcome) {
  TRY(check_held(database, worker, id, true));
  return changed_one(
             change(database,
                    "UPDATE jobs SET state = 'done', model_version = $1, message = $2 WHERE id = "
                    "$3 AND ($4 = '' OR cell = $4) AND state IN ('queued', 'running')",
                    model_version, message, id, cell),
             id)
      .map([&] { record_end(database, id, outcome); });
}

namespace {

/// One job, so that the others can be read even if this one cannot.
Result<StoredJob> read_alone(Database& database, std::int64_t id, const std::string& place) {
  try {
    return read_job(database, id);
  } catch (const DatabaseError& error) {
    if (error.kind() != DatabaseError::Kind::kOther) throw;
    return failure_of(error, place);
  }
}

Result<StoredJob> insert_job_over(Database& database, const StoredJob& job) {
  for (const std::string& id : job.batch_ids) {
    if (!exists(database, "SELECT 1 FROM batches WHERE cell = $1 AND id = $2", job.cell, id)) {
      return failure(ErrorCode::kNotFound, "cell {} has no batch {}", job.cell, id)
          .of("batch")
          .with_text(id);
    }
    if (exists(database, "SELECT 1 FROM discarded WHERE cell = $1 AND batch = $2", job.cell, id))
      return discarded_failure(job.cell, id);
  }
  const std::int64_t id = insert_job(database, job);
  insert_job_batches(database, id, job.cell, job.batch_ids);
  return read_job(database, id);
}

/// The end of a job that made no model.
void record_job_end(Database& database, std::int64_t id, const std::string& verdict,
                    const std::string& message, const ChangeId& by) {
  record_audit(
      database,
      {cell_of_job(database, id), "job", fmt::format("job {}", id), "open", verdict, message}, by);
}

const char* asked_for(JobKind kind) {
  switch (kind) {
    case JobKind::kTrain:
      return "training asked";
    case JobKind::kDiagnose:
      return "diagnosis asked";
    case JobKind::kCheck:
      return "check asked";
  }
  return "training asked";
}

/// The details that the audit trail records beside the request.
std::string details_of(const AskedJob& asked) {
  const auto* training = std::get_if<AskedTraining>(&asked);
  if (training != nullptr && !training->level.empty()) return ", level " + training->level;
  const auto* check = std::get_if<AskedCheck>(&asked);
  if (check == nullptr || !check->tolerance) return "";
  return fmt::format(", tolerance {:g} mm", to_mm(*check->tolerance));
}

/// Queues the job that `insert` makes, or returns the job that was queued under this id before.
template <typename Insert>
Result<StoredJob> queue_once(Database& database, const StoredJob& job, const ChangeId& change_id,
                             const Insert& insert) {
  const auto queued = TRY(once(database, job.cell, change_id, [&] {
    return insert().map([&](const StoredJob& made) {
      record_audit(database,
                   {made.cell, asked_for(made.kind()), fmt::format("job {}", made.id), "",
                    fmt::format("of {}{}{}", made.batch_ids.empty() ? "a batch sent with it" : "",
                                fmt::join(made.batch_ids, ", "), details_of(made.asked))},
                   change_id);
      return ChangeOutcome{0, made.id};
    });
  }));
  return read_job(database, queued.job);
}

}  // namespace

bool fail_job(Database& database, std::int64_t id, const std::string& message,
              const JobOutcome& outcome, const ChangeId& by) {
  if (change(database,
             "UPDATE jobs SET state = 'failed', message = $1 WHERE id = $2 AND state IN ('queued', "
             "'running')",
             message, id) != 1)
    return false;
  record_end(database, id, outcome);
  record_job_end(database, id, to_text(outcome.verdict), message, by);
  return true;
}

Result<std::set<std::string>> Store::batches_of_version(const std::string& cell,
                                                        int version) const {
  return connection_->exclusively([&](Database& database) -> Result<std::set<std::string>> {
    auto rows = prepare(database,
                        "SELECT batch FROM job_batches JOIN jobs ON jobs.id = job_batches.job "
                        "WHERE jobs.cell = $1 AND model_version = $2",
                        cell, version);
    std::set<std::string> ids;
    while (rows.next()) ids.insert(rows.text(0));
    return ids;
  });
}

Result<StoredJob> Store::add_job(const StoredJob& job, bool release, const ChangeId& change_id) {
  return connection_->in_transaction([&](Database& database) {
    return queue_once(database, job, change_id, [&]() -> Result<StoredJob> {
      Result<StoredJob> queued = insert_job_over(database, job);
      if (!queued || !release) return queued;
      for (const std::string& id : job.batch_ids)
        change(database, "INSERT INTO job_releases (job, cell, batch) VALUES ($1, $2, $3)",
               queued->id, job.cell, id);
      return queued;
    });
  });
}

Result<bool> Store::may_release(std::int64_t job) const {
  return connection_->exclusively([&](Database& database) -> Result<bool> {
    return exists(database, "SELECT 1 FROM job_releases WHERE job = $1 LIMIT 1", job);
  });
}

Result<bool> Store::was_made_by_job(const std::string& cell, int version) const {
  return connection_->exclusively([&](Database& database) -> Result<bool> {
    return exists(database, "SELECT 1 FROM jobs WHERE cell = $1 AND model_version = $2 LIMIT 1",
                  cell, version);
  });
}

Result<StoredJob> Store::add_diagnosis(const StoredJob& job, const std::string& csv,
                                       const ChangeId& change_id) {
  return connection_->in_transaction([&](Database& database) {
    return queue_once(database, job, change_id, [&]() -> Result<StoredJob> {
      const auto queued = TRY(insert_job_over(database, job));
      const auto* asked = std::get_if<AskedDiagnosis>(&job.asked);
      change(database, "INSERT INTO diagnoses (job, csv, apply) VALUES ($1, $2, $3)", queued.id,
             csv, asked != nullptr && asked->apply ? 1 : 0);
      return queued;
    });
  });
}

Result<StoredJob> Store::job(std::int64_t id) const {
  return connection_->exclusively([&](Database& database) { return read_job(database, id); });
}

Result<std::vector<StoredJob>> Store::jobs(const std::set<std::int64_t>& ids) const {
  if (ids.empty()) return std::vector<StoredJob>();
  const std::string wanted =
      fmt::format("{}WHERE id IN ({}) ORDER BY id", kJobColumns, list_of(ids));
  return connection_->exclusively([&](Database& database) -> Result<std::vector<StoredJob>> {
    return jobs_of(database, prepare(database, wanted.c_str()));
  });
}

Result<std::set<std::int64_t>> Store::came_with_batches(const std::set<std::int64_t>& ids) const {
  if (ids.empty()) return std::set<std::int64_t>();
  const std::string wanted = fmt::format(
      "SELECT own.job FROM job_batches AS own JOIN batches ON batches.cell = own.cell AND "
      "batches.id = own.batch WHERE own.job IN ({}) AND batches.job = own.job",
      list_of(ids));
  return connection_->exclusively([&](Database& database) -> Result<std::set<std::int64_t>> {
    std::set<std::int64_t> came;
    auto rows = prepare(database, wanted.c_str());
    while (rows.next()) came.insert(rows.integer64(0));
    return came;
  });
}

Result<std::vector<StoredJob>> Store::unfinished_jobs() const {
  const std::string all =
      fmt::format("{}WHERE state IN ('queued', 'running') ORDER BY id", kJobColumns);
  return connection_->exclusively([&](Database& database) -> Result<std::vector<StoredJob>> {
    if (database.is_shared()) return jobs_of(database, prepare(database, all.c_str()));
    std::vector<std::int64_t> ids;  // of a file each is read alone: a row may be damaged
    Rows rows =
        prepare(database, "SELECT id FROM jobs WHERE state IN ('queued', 'running') ORDER BY id");
    while (rows.next()) ids.push_back(rows.integer64(0));
    std::vector<StoredJob> jobs;
    for (const std::int64_t id : ids) {
      auto job = read_alone(database, id, connection_->path);
      if (job) jobs.push_back(std::move(*job));
      if (!job) connection_->note_damage(fmt::format("job {}: {}", id, sentence(job.error())));
    }
    return jobs;
  });
}

Result<std::vector<StoredJob>> Store::recent_jobs(const std::string& cell, int finished) const {
  // Each part by its own index: one condition for all three would read every job that ever was.
  const auto last = [](const char* state) {
    return fmt::format(
        " UNION ALL SELECT id FROM (SELECT id FROM jobs WHERE ($1 = '' OR cell = $1) AND state = "
        "'{0}' ORDER BY id DESC LIMIT $2) AS last_{0}",
        state);
  };
  const std::string wanted = std::string(kJobColumns) +
                             "WHERE id IN (SELECT id FROM jobs WHERE ($1 = '' OR cell = $1) AND "
                             "state IN ('queued', 'running')" +
                             last("done") + last("failed") + ") ORDER BY id";
  return connection_->exclusively([&](Database& database) -> Result<std::vector<StoredJob>> {
    return jobs_of(database, prepare(database, wanted.c_str(), cell, finished));
  });
}

Status Store::set_job_running(std::int64_t id) {
  return connection_->in_transaction([&](Database& database) {
    return claim_job(database, connection_->worker, id).map([&] { record_start(database, id); });
  });
}

Status Store::set_job_queued(std::int64_t id, bool attempt_counts) {
  return connection_->in_transaction([&](Database& database) -> Status {
    TRY(check_held(database, connection_->worker, id));
    // A waiting job gets no attempt back, since its attempts may be another server's.
    const int changes = change(
        database,
        "UPDATE jobs SET state = 'queued', attempts = attempts - CASE WHEN attempts > 0 AND state "
        "= 'running' THEN $1 ELSE 0 END WHERE id = $2 AND state IN ('queued', 'running')",
        attempt_counts ? 0 : 1, id);
    tell_others(database);
    return changed_one(changes, id);
  });
}

Status Store::set_job_failed(std::int64_t id, const std::string& message, const JobOutcome& outcome,
                             const ChangeId& by) {
  const auto fail = [&](Database& database) -> Result<ChangeOutcome> {
    TRY(check_held(database, connection_->worker, id));
    return changed_one(fail_job(database, id, message, outcome, by) ? 1 : 0, id).map([&] {
      return ChangeOutcome{0, id};
    });
  };
  const auto failed = connection_->in_transaction([&](Database& database) {
    return once(database, cell_of_job(database, id), by, [&] { return fail(database); });
  });
  return failed.map([](const ChangeOutcome&) {});
}

Status Store::set_job_done(std::int64_t id, const std::string& message, const JobOutcome& outcome) {
  return connection_->in_transaction([&](Database& database) {
    return end_job(database, connection_->worker, id, "", 0, message, outcome).map([&] {
      record_job_end(database, id, to_text(outcome.verdict), message, {});
    });
  });
}

}  // namespace trammel
