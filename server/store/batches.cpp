#include <utility>

#include "server/base/hash.h"
#include "server/store/audit_rows.h"
#include "server/store/cell_rows.h"
#include "server/store/changes.h"
#include "server/store/connection.h"
#include "server/store/job_rows.h"
#include "server/store/pruned.h"
#include "server/store/store.h"

// Batches: their text as received, and which of them are in quarantine.

namespace trammel {
namespace {

/// The batches of the cell $1, see Store::batches_learned_from(). Without a reference to the row,
/// so that it is read once.
const std::string& learned_batches() {
  static const std::string batches = fmt::format(
      "SELECT job_batches.batch FROM job_batches JOIN jobs ON jobs.id = job_batches.job LEFT JOIN "
      "job_outcomes ON job_outcomes.job = jobs.id WHERE jobs.cell = $1 AND jobs.state = 'done' AND "
      "jobs.model_version > 0 AND (COALESCE(job_outcomes.held_back, '') NOT IN ('{}', '{}') OR "
      "jobs.model_version IN (SELECT version FROM activations WHERE cell = $1))",
      to_text(HeldBack::kStopNote), to_text(HeldBack::kStepLimit));
  return batches;
}

const std::string& record_columns() {
  static const std::string columns = fmt::format(
      "SELECT id, hash, request_id, accepted_at, poses, job, quarantine, EXISTS (SELECT 1 FROM "
      "pruned WHERE pruned.kind = 'batch' AND pruned.cell = batches.cell AND pruned.id = "
      "batches.id), EXISTS (SELECT 1 FROM discarded WHERE discarded.cell = batches.cell AND "
      "discarded.batch = batches.id), id IN ({}), (SELECT CASE WHEN state IN ('queued', 'running') "
      "THEN '' WHEN message = '' THEN state ELSE message END FROM jobs WHERE jobs.id = "
      "batches.job) FROM batches WHERE cell = $1 ",
      learned_batches());
  return columns;
}

/// The batch in a row of record_columns(), without its text.
StoredBatch record_of(const std::string& cell, Rows& row) {
  StoredBatch batch{cell,           row.text(0),      "",
                    row.text(1),    row.text(2),      row.integer64(3),
                    row.integer(4), row.integer64(5), row.text(6)};
  batch.pruned = row.truth(7);
  batch.discarded = row.truth(8);
  batch.learned = row.truth(9);
  batch.outcome = row.text(10);
  return batch;
}

Result<StoredBatch> read_record(Database& database, const std::string& cell,
                                const std::string& id) {
  auto row = prepare(database, (record_columns() + "AND id = $2").c_str(), cell, id);
  if (!row.next())
    return failure(ErrorCode::kNotFound, "cell {} has no batch {}", cell, id)
        .of("batch")
        .with_text(id);
  return record_of(cell, row);
}

/// The word for the audit trail.
std::string spoken(const std::string& quarantine) {
  return quarantine.empty() ? "free" : "in quarantine: " + quarantine;
}

/// Returns the new job with the batch and its inputs; or the job and the hash of a batch that was
/// there before. In a database where each statement costs a round trip, this is one statement. The
/// cell is locked, so nobody else adds the batch meanwhile.
constexpr const char* kAddAtOnce =
    "WITH present AS (SELECT hash, job FROM batches WHERE cell = $1 AND id = $2), made AS (INSERT "
    "INTO jobs (cell, level, bias, state, message, created_at, kind) SELECT $1, $3, $4, 'queued', "
    "$5, CAST($6 AS BIGINT), $7 WHERE NOT EXISTS (SELECT 1 FROM present) RETURNING id), kept AS "
    "(INSERT INTO batches (cell, id, csv, hash, request_id, accepted_at, poses, job) SELECT $1, "
    "$2, CAST($8 AS BYTEA), $9, $10, CAST($11 AS BIGINT), CAST($12 AS BIGINT), id FROM made), "
    "listed AS (INSERT INTO job_batches (job, position, cell, batch) SELECT id, 0, $1, $2 FROM "
    "made) SELECT id, FALSE, '' FROM made UNION ALL SELECT job, TRUE, hash FROM present";

/// A batch that is stored, or was before.
struct KeptBatch {
  std::int64_t job = 0;
  bool was_there = false;
  std::string hash = {};  ///< of the existing batch
};

KeptBatch keep_at_once(Database& database, const StoredBatch& batch, const StoredJob& job) {
  const AskedTraining training = training_of(job);  // outlives the statement
  auto row = prepare(database, kAddAtOnce, batch.cell, batch.id, training.level, training.bias,
                     job.message, job.created_at, stored_kind(job.kind()), batch.csv, batch.hash,
                     batch.request_id, batch.accepted_at, batch.poses);
  if (!row.next())
    throw DatabaseError(DatabaseError::Kind::kAgain,
                        "the batch is neither there nor was it stored");
  return {row.integer64(0), row.truth(1), row.text(2)};
}

KeptBatch keep(Database& database, const StoredBatch& batch, const StoredJob& job) {
  if (database.is_shared()) return keep_at_once(database, batch, job);
  auto present = prepare(database, "SELECT hash, job FROM batches WHERE cell = $1 AND id = $2",
                         batch.cell, batch.id);
  if (present.next()) return {present.integer64(1), true, present.text(0)};
  const std::int64_t id = insert_job(database, job);
  change(database,
         "INSERT INTO batches (cell, id, csv, hash, request_id, accepted_at, poses, job) VALUES "
         "($1, $2, $3, $4, $5, $6, $7, $8)",
         batch.cell, batch.id, batch.csv, batch.hash, batch.request_id, batch.accepted_at,
         batch.poses, id);
  insert_job_batches(database, id, batch.cell, {batch.id});
  return {id};
}

/// The job as it was queued with its batch just now.
StoredJob queued_with(const StoredBatch& batch, StoredJob job, std::int64_t id) {
  job.id = id;
  job.batch_ids = {batch.id};
  job.state = JobState::kQueued;
  return job;
}

Failure other_content(const StoredBatch& batch, std::int64_t job) {
  return failure(ErrorCode::kConflict, "cell {} already has a batch {} with other content (job {})",
                 batch.cell, batch.id, job)
      .of("batch")
      .with_text(batch.id);
}

}  // namespace

Failure discarded_failure(const std::string& cell, const std::string& id) {
  return failure(ErrorCode::kConflict, "batch {} of cell {} was discarded", id, cell)
      .of("batch")
      .with_text(id)
      .next("submit it again under another id if it is good");
}

Result<AcceptedJob> Store::add_batch(const StoredBatch& batch, const StoredJob& job) {
  return connection_->in_transaction([&](Database& database) -> Result<AcceptedJob> {
    lock_cell(database, batch.cell);
    const KeptBatch kept = keep(database, batch, job);
    if (kept.was_there && kept.hash != batch.hash) return other_content(batch, kept.job);
    // A repeat, or a client that lost its receipt.
    if (kept.was_there)
      return read_job(database, kept.job).map([](StoredJob made) {
        return AcceptedJob{std::move(made), true};
      });
    record_audit(database,
                 {batch.cell, "batch", "batch " + batch.id, "",
                  fmt::format("{} poses, sha256 {}, job {}", batch.poses, batch.hash, kept.job)},
                 {batch.request_id, "", batch.who});
    return AcceptedJob{queued_with(batch, job, kept.job), false};
  });
}

Status Store::set_quarantine(const std::string& cell, const std::string& id,
                             const std::string& reason, const ChangeId& change_id,
                             std::int64_t by_job) {
  const auto changed =
      connection_->in_transaction([&](Database& database) -> Result<ChangeOutcome> {
        if (by_job != 0) {
          lock_cell(database, cell);
          TRY(check_held(database, connection_->worker, by_job, true));
        }
        return once(database, cell, change_id, [&]() -> Result<ChangeOutcome> {
          const auto batch = TRY(read_record(database, cell, id));
          if (batch.discarded) return discarded_failure(cell, id);
          if (reason.empty() && batch.quarantine.empty())
            return failure(ErrorCode::kConflict, "batch {} of cell {} is not in quarantine: {}", id,
                           cell, batch.learned ? "a model was made of it" : "trainings may take it")
                .of("batch")
                .with_text(id)
                .next("nothing is to be released; trammel retrain trains from it");
          if (batch.quarantine == reason) return ChangeOutcome{};
          change(database, "UPDATE batches SET quarantine = $1 WHERE cell = $2 AND id = $3", reason,
                 cell, id);
          record_audit(database,
                       {cell, reason.empty() ? "release" : "quarantine", "batch " + id,
                        spoken(batch.quarantine), spoken(reason)},
                       change_id);
          return ChangeOutcome{};
        });
      });
  return changed.map([](const ChangeOutcome&) {});
}

Status Store::discard(const std::string& cell, const std::string& id, const ChangeId& change_id) {
  const auto changed = connection_->in_transaction([&](Database& database) {
    return once(database, cell, change_id, [&]() -> Result<ChangeOutcome> {
      const auto batch = TRY(read_record(database, cell, id));
      if (batch.discarded) return ChangeOutcome{};
      const std::string now =
          "discarded" + (change_id.reason.empty() ? "" : ": " + change_id.reason);
      change(database, "UPDATE batches SET quarantine = $1 WHERE cell = $2 AND id = $3", now, cell,
             id);
      change(database, "INSERT INTO discarded (cell, batch) VALUES ($1, $2)", cell, id);
      record_audit(database, {cell, "discard", "batch " + id, spoken(batch.quarantine), now},
                   change_id);
      return ChangeOutcome{};
    });
  });
  return changed.map([](const ChangeOutcome&) {});
}

Result<StoredBatch> Store::batch(const std::string& cell, const std::string& id) const {
  auto batch = connection_->exclusively([&](Database& database) -> Result<StoredBatch> {
    auto record = read_record(database, cell, id);
    if (!record) return record;
    if (record->pruned)
      return pruned_failure(fmt::format("batch {} of cell {}", id, cell)).of("batch").with_text(id);
    auto row = prepare(database, "SELECT csv FROM batches WHERE cell = $1 AND id = $2", cell, id);
    if (!row.next()) return failure(ErrorCode::kNotFound, "cell {} has no batch {}", cell, id);
    record->csv = row.text(0);
    return record;
  });
  // Without the lock: hashing a large text takes a while.
  if (batch && sha256_hex(batch->csv) != batch->hash) {
    return failure(ErrorCode::kInternal,
                   "batch {} of cell {} is not what was accepted: its hash should be {}", id, cell,
                   batch->hash)
        .in(connection_->path);
  }
  return batch;
}

Result<StoredBatch> Store::batch_record(const std::string& cell, const std::string& id) const {
  return connection_->exclusively(
      [&](Database& database) { return read_record(database, cell, id); });
}

Result<std::vector<StoredBatch>> Store::batches(const std::string& cell) const {
  return connection_->exclusively([&](Database& database) -> Result<std::vector<StoredBatch>> {
    auto rows = prepare(database, (record_columns() + "ORDER BY number").c_str(), cell);
    std::vector<StoredBatch> batches;
    while (rows.next()) batches.push_back(record_of(cell, rows));
    return batches;
  });
}

Result<std::set<std::string>> Store::batches_learned_from(const std::string& cell) const {
  return connection_->exclusively([&](Database& database) -> Result<std::set<std::string>> {
    auto rows = prepare(database, learned_batches().c_str(), cell);
    std::set<std::string> ids;
    while (rows.next()) ids.insert(rows.text(0));
    return ids;
  });
}

}  // namespace trammel
