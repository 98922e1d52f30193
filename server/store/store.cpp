#include "server/store/store.h"

#include <SQLiteCpp/SQLiteCpp.h>
#include <sqlite3.h>

#include <array>
#include <chrono>
#include <exception>
#include <mutex>
#include <string_view>
#include <utility>

#include "server/base/hash.h"
#include "server/store/file_header.h"
#include "server/store/writer_lock.h"

namespace trammel {
namespace {

constexpr int kPagesKept = 20;      // of diagnoses; their findings are kept for ever
constexpr int kBusyTimeout = 5000;  // ms, for whoever else reads the file

constexpr const char* kSchema = R"sql(
CREATE TABLE jobs (
  id            INTEGER PRIMARY KEY AUTOINCREMENT,
  cell          TEXT    NOT NULL,
  level         TEXT    NOT NULL,
  bias          TEXT    NOT NULL,
  state         TEXT    NOT NULL CHECK (state IN ('queued', 'running', 'done', 'failed')),
  message       TEXT    NOT NULL,
  created_at    INTEGER NOT NULL,
  model_version INTEGER NOT NULL DEFAULT 0,
  attempts      INTEGER NOT NULL DEFAULT 0
);
CREATE INDEX jobs_unfinished ON jobs (id) WHERE state IN ('queued', 'running');

CREATE TABLE batches (
  number      INTEGER PRIMARY KEY AUTOINCREMENT,
  cell        TEXT    NOT NULL,
  id          TEXT    NOT NULL,
  csv         TEXT    NOT NULL,
  hash        TEXT    NOT NULL,
  request_id  TEXT    NOT NULL,
  accepted_at INTEGER NOT NULL,
  poses       INTEGER NOT NULL,
  job         INTEGER NOT NULL REFERENCES jobs (id),
  UNIQUE (cell, id)
);

CREATE TABLE job_batches (
  job      INTEGER NOT NULL REFERENCES jobs (id),
  position INTEGER NOT NULL,
  cell     TEXT    NOT NULL,
  batch    TEXT    NOT NULL,
  PRIMARY KEY (job, position),
  FOREIGN KEY (cell, batch) REFERENCES batches (cell, id)
) WITHOUT ROWID;

CREATE TABLE models (
  cell           TEXT    NOT NULL,
  version        INTEGER NOT NULL,
  id             TEXT    NOT NULL,
  hash           TEXT    NOT NULL,
  level          TEXT    NOT NULL,
  batch_id       TEXT    NOT NULL,
  created_at     INTEGER NOT NULL,
  training_poses INTEGER NOT NULL,
  validation_rms REAL    NOT NULL,
  content        TEXT    NOT NULL,
  PRIMARY KEY (cell, version)
);

-- What was in force, newest last, never changed afterwards. `back` is where a rollback from here leads.
CREATE TABLE activations (
  number       INTEGER PRIMARY KEY AUTOINCREMENT,
  cell         TEXT    NOT NULL,
  version      INTEGER NOT NULL,
  back         INTEGER REFERENCES activations (number),
  activated_at INTEGER NOT NULL,
  FOREIGN KEY (cell, version) REFERENCES models (cell, version)
);
CREATE INDEX activations_by_cell ON activations (cell, number);
)sql";

/// What version 2 added to version 1.
constexpr const char* kSchemaAdded = R"sql(
ALTER TABLE jobs ADD COLUMN kind TEXT NOT NULL DEFAULT 'train' CHECK (kind IN ('train', 'diagnose'));
ALTER TABLE batches ADD COLUMN quarantine TEXT NOT NULL DEFAULT '';

CREATE TABLE diagnoses (
  job      INTEGER PRIMARY KEY REFERENCES jobs (id),
  csv      TEXT    NOT NULL,
  apply    INTEGER NOT NULL,
  findings TEXT    NOT NULL DEFAULT '',
  page     TEXT    NOT NULL DEFAULT ''
);
)sql";

/// Beside the tables of the schema, so that programs that do not know them can still open the file: when jobs began and
/// ended, when models were trained and the newest of their measurements taken (Unix time, s; NULL = not recorded);
/// which batches in quarantine a job may train from, and releases if its model goes in force.
constexpr const char* kTimes = R"sql(
CREATE TABLE IF NOT EXISTS job_times (
  job         INTEGER PRIMARY KEY REFERENCES jobs (id),
  started_at  INTEGER,
  finished_at INTEGER
);
CREATE TABLE IF NOT EXISTS job_releases (
  job   INTEGER NOT NULL REFERENCES jobs (id),
  cell  TEXT    NOT NULL,
  batch TEXT    NOT NULL,
  PRIMARY KEY (job, batch),
  FOREIGN KEY (cell, batch) REFERENCES batches (cell, id)
) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS model_times (
  cell        TEXT    NOT NULL,
  version     INTEGER NOT NULL,
  trained_at  INTEGER NOT NULL,
  measured_at INTEGER,
  PRIMARY KEY (cell, version),
  FOREIGN KEY (cell, version) REFERENCES models (cell, version)
) WITHOUT ROWID;
INSERT INTO model_times (cell, version, trained_at)
  SELECT cell, version, json_extract(content, '$.stamp.trained_at') FROM models
  WHERE NOT EXISTS (SELECT 1 FROM model_times t WHERE t.cell = models.cell AND t.version = models.version)
    AND json_valid(content) AND json_type(content, '$.stamp.trained_at') = 'integer';
)sql";

constexpr std::array<std::pair<JobState, const char*>, 4> kJobStates = {{{JobState::kQueued, "queued"},
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
  return JobState::kFailed;  // the schema's CHECK lets no other text in
}

std::int64_t now() {
  return std::chrono::duration_cast<std::chrono::seconds>(std::chrono::system_clock::now().time_since_epoch()).count();
}

/// A prepared statement with its values bound in order.
template <typename... Values>
SQLite::Statement prepare(SQLite::Database& database, const char* sql, const Values&... values) {
  SQLite::Statement statement(database, sql);
  int index = 0;
  (statement.bind(++index, values), ...);
  return statement;
}

/// Runs a statement that changes something; returns how many rows it changed.
template <typename... Values>
int change(SQLite::Database& database, const char* sql, const Values&... values) {
  return prepare(database, sql, values...).exec();
}

/// Of the change of one unfinished job.
Status changed_one(int changes, std::int64_t id) {
  if (changes == 1) return {};
  return failure(ErrorCode::kNotFound, "job {} does not exist or is finished", id).of("job").with_value(id);
}

std::vector<std::string> batches_of(SQLite::Database& database, std::int64_t job) {
  auto rows = prepare(database, "SELECT batch FROM job_batches WHERE job = ? ORDER BY position", job);
  std::vector<std::string> ids;
  while (rows.executeStep()) ids.push_back(rows.getColumn(0).getString());
  return ids;
}

constexpr const char* kJobColumns =
    "SELECT id, cell, level, bias, state, message, created_at, model_version, attempts, kind, started_at, finished_at "
    "FROM jobs LEFT JOIN job_times ON job_times.job = jobs.id ";

std::optional<std::int64_t> optional_integer(SQLite::Statement& row, int column) {
  if (row.isColumnNull(column)) return std::nullopt;
  return row.getColumn(column).getInt64();
}

StoredJob job_of(SQLite::Database& database, SQLite::Statement& row) {
  StoredJob job;
  job.id = row.getColumn(0).getInt64();
  job.cell = row.getColumn(1).getString();
  job.level = row.getColumn(2).getString();
  job.bias = row.getColumn(3).getString();
  job.state = job_state_of(row.getColumn(4).getString());
  job.message = row.getColumn(5).getString();
  job.created_at = row.getColumn(6).getInt64();
  job.model_version = row.getColumn(7).getInt();
  job.attempts = row.getColumn(8).getInt();
  job.kind = row.getColumn(9).getString() == "diagnose" ? JobKind::kDiagnose : JobKind::kTrain;
  job.started_at = optional_integer(row, 10);
  job.finished_at = optional_integer(row, 11);
  job.batch_ids = batches_of(database, job.id);
  return job;
}

Result<StoredJob> read_job(SQLite::Database& database, std::int64_t id) {
  auto row = prepare(database, (std::string(kJobColumns) + "WHERE id = ?").c_str(), id);
  if (!row.executeStep()) return failure(ErrorCode::kNotFound, "job {} does not exist", id).of("job").with_value(id);
  return job_of(database, row);
}

std::vector<StoredJob> jobs_of(SQLite::Database& database, SQLite::Statement rows) {
  std::vector<StoredJob> jobs;
  while (rows.executeStep()) jobs.push_back(job_of(database, rows));
  return jobs;
}

void record_start(SQLite::Database& database, std::int64_t job) {
  change(database,
         "INSERT INTO job_times (job, started_at) VALUES (?, ?) "
         "ON CONFLICT (job) DO UPDATE SET started_at = excluded.started_at",
         job, now());
}

void record_end(SQLite::Database& database, std::int64_t job) {
  change(database,
         "INSERT INTO job_times (job, finished_at) VALUES (?, ?) "
         "ON CONFLICT (job) DO UPDATE SET finished_at = excluded.finished_at",
         job, now());
}

std::int64_t insert_job(SQLite::Database& database, const StoredJob& job) {
  change(database,
         "INSERT INTO jobs (cell, level, bias, state, message, created_at, kind) VALUES (?, ?, ?, ?, ?, ?, ?)",
         job.cell, job.level, job.bias, to_text(JobState::kQueued), job.message, job.created_at,
         job.kind == JobKind::kDiagnose ? "diagnose" : "train");
  return database.getLastInsertRowid();
}

void insert_job_batches(SQLite::Database& database, std::int64_t job, const std::string& cell,
                        const std::vector<std::string>& batch_ids) {
  int position = 0;
  for (const std::string& id : batch_ids) {
    change(database, "INSERT INTO job_batches (job, position, cell, batch) VALUES (?, ?, ?, ?)", job, position++, cell,
           id);
  }
}

Result<StoredJob> insert_job_over(SQLite::Database& database, const StoredJob& job) {
  for (const std::string& id : job.batch_ids) {
    if (!prepare(database, "SELECT 1 FROM batches WHERE cell = ? AND id = ?", job.cell, id).executeStep()) {
      return failure(ErrorCode::kNotFound, "cell {} has no batch {}", job.cell, id).of("batch").with_text(id);
    }
  }
  const std::int64_t id = insert_job(database, job);
  insert_job_batches(database, id, job.cell, job.batch_ids);
  return read_job(database, id);
}

/// The newest line of a cell's history of what was in force.
struct Activation {
  std::int64_t number = 0;
  int version = 0;
  std::optional<std::int64_t> back;
};

std::optional<Activation> activation_of(SQLite::Statement row) {
  if (!row.executeStep()) return std::nullopt;
  Activation activation{row.getColumn(0).getInt64(), row.getColumn(1).getInt(), std::nullopt};
  if (!row.isColumnNull(2)) activation.back = row.getColumn(2).getInt64();
  return activation;
}

std::optional<Activation> present_activation(SQLite::Database& database, const std::string& cell) {
  return activation_of(prepare(
      database, "SELECT number, version, back FROM activations WHERE cell = ? ORDER BY number DESC LIMIT 1", cell));
}

/// Where rolling back again and again leads, the next one first.
Result<std::vector<Activation>> activations_before(SQLite::Database& database, const std::string& cell) {
  const auto present = present_activation(database, cell);
  if (!present) return failure(ErrorCode::kNotFound, "cell {} has no model in force", cell).of("cell").with_text(cell);
  if (!present->back) {
    return failure(ErrorCode::kNotFound, "cell {}: no model was in force before version {}", cell, present->version)
        .of("version")
        .with_value(present->version);
  }
  std::vector<Activation> before;
  for (auto back = present->back; back; back = before.back().back) {
    before.push_back(
        activation_of(prepare(database, "SELECT number, version, back FROM activations WHERE number = ?", *back))
            .value());
  }
  return before;
}

void insert_activation(SQLite::Database& database, const std::string& cell, int version,
                       const std::optional<std::int64_t>& back) {
  SQLite::Statement row(database, "INSERT INTO activations (cell, version, back, activated_at) VALUES (?, ?, ?, ?)");
  row.bind(1, cell);
  row.bind(2, version);
  if (back) row.bind(3, *back);  // unbound is NULL
  row.bind(4, now());
  row.exec();
}

/// Puts `version` in force on top of what is; the batches that its job may release leave quarantine.
void activate_on_top(SQLite::Database& database, const std::string& cell, int version) {
  change(database,
         "UPDATE batches SET quarantine = '' WHERE cell = ? AND id IN (SELECT batch FROM job_releases JOIN jobs "
         "ON jobs.id = job_releases.job WHERE jobs.cell = ? AND jobs.model_version = ?)",
         cell, cell, version);
  const auto present = present_activation(database, cell);
  if (present && present->version == version) return;
  insert_activation(database, cell, version, present ? std::optional(present->number) : std::nullopt);
}

void insert_model_times(SQLite::Database& database, const std::string& cell, int version,
                        const ModelProvenance& provenance) {
  SQLite::Statement row(database,
                        "INSERT INTO model_times (cell, version, trained_at, measured_at) VALUES (?, ?, ?, ?)");
  row.bind(1, cell);
  row.bind(2, version);
  row.bind(3, provenance.trained_at);
  if (provenance.measured_at) row.bind(4, *provenance.measured_at);  // unbound is NULL
  row.exec();
}

int next_version(SQLite::Database& database, const std::string& cell) {
  auto row = prepare(database, "SELECT COALESCE(MAX(version), 0) + 1 FROM models WHERE cell = ?", cell);
  row.executeStep();
  return row.getColumn(0).getInt();
}

/// Ours, or empty and to be ours; nothing is changed here.
Status check_owner(SQLite::Database& database, const std::string& path) {
  const int application = database.execAndGet("PRAGMA application_id").getInt();
  const int schema = database.execAndGet("PRAGMA user_version").getInt();
  const bool empty = database.execAndGet("SELECT COUNT(*) FROM sqlite_master").getInt() == 0;
  if (empty && application == 0 && schema == 0) return {};
  if (application != kApplicationId) {
    return refused("a database of another program (application id {:#x}, not {:#x})", application, kApplicationId)
        .in(path);
  }
  if (schema > kSchemaVersion) {
    return refused("schema {} is newer than this program's, limit {}", schema, kSchemaVersion)
        .in(path)
        .of("schema")
        .beyond(schema, kSchemaVersion)
        .next("start a newer one");
  }
  const std::string damage = database.execAndGet("PRAGMA quick_check(1)").getString();
  if (damage != "ok") return failure(ErrorCode::kInternal, "damaged: {}", damage).in(path);
  return {};
}

Status prepare_file(SQLite::Database& database, const std::string& path) {
  if (auto owner = check_owner(database, path); !owner) return owner;
  const std::string mode = database.execAndGet("PRAGMA journal_mode = WAL").getString();
  if (mode != "wal") return failure(ErrorCode::kInternal, "this file system cannot hold a WAL ({})", mode).in(path);
  database.exec("PRAGMA synchronous = FULL");
  database.exec("PRAGMA foreign_keys = ON");
  const int schema = database.execAndGet("PRAGMA user_version").getInt();
  SQLite::Transaction transaction(database, SQLite::TransactionBehavior::IMMEDIATE);
  if (schema == 0) database.exec(kSchema);
  if (schema < kSchemaVersion) {
    database.exec(kSchemaAdded);
    database.exec(fmt::format("PRAGMA application_id = {}", kApplicationId));
    database.exec(fmt::format("PRAGMA user_version = {}", kSchemaVersion));
  }
  database.exec(kTimes);
  transaction.commit();
  return {};
}

}  // namespace

struct Store::Connection {
  Connection(std::string file, WriterLock writer)
      : path(std::move(file)),
        lock(std::move(writer)),
        database(path, SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE, kBusyTimeout) {}

  /// `work(database)` alone at the connection; what SQLite throws becomes kInternal.
  template <typename Work>
  auto exclusively(const Work& work) -> decltype(work(std::declval<SQLite::Database&>())) {
    const std::lock_guard guard(mutex);
    try {
      return work(database);
    } catch (const SQLite::Exception& error) {
      return failure(ErrorCode::kInternal, "{} (SQLite error {})", error.what(), error.getExtendedErrorCode()).in(path);
    } catch (const std::exception& error) {
      return failure(ErrorCode::kInternal, "{}", error.what()).in(path);
    }
  }

  /// The same in one transaction, which holds only if `work` succeeds.
  template <typename Work>
  auto in_transaction(const Work& work) -> decltype(work(std::declval<SQLite::Database&>())) {
    return exclusively([&work](SQLite::Database& open) {
      SQLite::Transaction transaction(open, SQLite::TransactionBehavior::IMMEDIATE);
      auto result = work(open);
      if (result) transaction.commit();
      return result;
    });
  }

  const std::string path;
  const WriterLock lock;
  std::mutex mutex;
  SQLite::Database database;  // guarded by mutex
};

Store::Store(std::unique_ptr<Connection> connection) : connection_(std::move(connection)) {}
Store::~Store() = default;

Result<std::unique_ptr<Store>> Store::open(const std::string& path) {
  auto lock = WriterLock::take(path);
  if (!lock) return tl::make_unexpected(lock.error());
  try {
    auto connection = std::make_unique<Connection>(path, std::move(*lock));
    const Status ready = connection->exclusively([&path](SQLite::Database& d) { return prepare_file(d, path); });
    if (!ready) return tl::make_unexpected(ready.error());
    return std::unique_ptr<Store>(new Store(std::move(connection)));
  } catch (const std::exception& error) {
    return failure(ErrorCode::kInternal, "cannot be opened: {}", error.what()).in(path);
  }
}

Result<StoredJob> Store::add_batch(const StoredBatch& batch, const StoredJob& job) {
  return connection_->in_transaction([&](SQLite::Database& database) -> Result<StoredJob> {
    auto present =
        prepare(database, "SELECT request_id, hash, job FROM batches WHERE cell = ? AND id = ?", batch.cell, batch.id);
    if (present.executeStep()) {
      const bool same_content = present.getColumn(1).getString() == batch.hash;
      const std::int64_t made = present.getColumn(2).getInt64();
      if (same_content && present.getColumn(0).getString() == batch.request_id) return read_job(database, made);
      return failure(ErrorCode::kConflict, "cell {} already has a batch {} with {} content (job {})", batch.cell,
                     batch.id, same_content ? "the same" : "other", made)
          .of("batch")
          .with_text(batch.id);
    }
    const std::int64_t id = insert_job(database, job);
    change(database,
           "INSERT INTO batches (cell, id, csv, hash, request_id, accepted_at, poses, job) "
           "VALUES (?, ?, ?, ?, ?, ?, ?, ?)",
           batch.cell, batch.id, batch.csv, batch.hash, batch.request_id, batch.accepted_at, batch.poses, id);
    insert_job_batches(database, id, batch.cell, {batch.id});
    return read_job(database, id);
  });
}

Result<StoredJob> Store::add_job(const StoredJob& job, bool release) {
  return connection_->in_transaction([&](SQLite::Database& database) {
    Result<StoredJob> queued = insert_job_over(database, job);
    if (!queued || !release) return queued;
    for (const std::string& id : job.batch_ids)
      change(database, "INSERT INTO job_releases (job, cell, batch) VALUES (?, ?, ?)", queued->id, job.cell, id);
    return queued;
  });
}

Result<bool> Store::may_release(std::int64_t job) const {
  return connection_->exclusively([&](SQLite::Database& database) -> Result<bool> {
    SQLite::Statement query(database, "SELECT EXISTS (SELECT 1 FROM job_releases WHERE job = ?)");
    query.bind(1, job);
    query.executeStep();
    return query.getColumn(0).getInt() != 0;
  });
}

Result<StoredJob> Store::add_diagnosis(const StoredJob& job, const StoredDiagnosis& diagnosis) {
  return connection_->in_transaction([&](SQLite::Database& database) {
    Result<StoredJob> queued = insert_job_over(database, job);
    if (queued) {
      change(database, "INSERT INTO diagnoses (job, csv, apply) VALUES (?, ?, ?)", queued->id, diagnosis.csv,
             diagnosis.apply ? 1 : 0);
    }
    return queued;
  });
}

Result<StoredDiagnosis> Store::diagnosis(std::int64_t job) const {
  return connection_->exclusively([&](SQLite::Database& database) -> Result<StoredDiagnosis> {
    auto row = prepare(database, "SELECT csv, apply, findings, page FROM diagnoses WHERE job = ?", job);
    if (!row.executeStep())
      return failure(ErrorCode::kNotFound, "job {} is no diagnosis", job).of("job").with_value(job);
    return StoredDiagnosis{row.getColumn(0).getString(), row.getColumn(1).getInt() != 0, row.getColumn(2).getString(),
                           row.getColumn(3).getString()};
  });
}

Status Store::store_findings(std::int64_t job, const std::string& findings, const std::string& page) {
  return connection_->in_transaction([&](SQLite::Database& database) -> Status {
    const int changes =
        change(database, "UPDATE diagnoses SET findings = ?, page = ? WHERE job = ?", findings, page, job);
    change(database,
           "UPDATE diagnoses SET page = '' WHERE page <> '' AND job NOT IN "
           "(SELECT job FROM diagnoses WHERE page <> '' ORDER BY job DESC LIMIT ?)",
           kPagesKept);
    return changed_one(changes, job);
  });
}

Status Store::set_quarantine(const std::string& cell, const std::string& id, const std::string& reason) {
  return connection_->in_transaction([&](SQLite::Database& database) -> Status {
    const int changes =
        change(database, "UPDATE batches SET quarantine = ? WHERE cell = ? AND id = ?", reason, cell, id);
    if (changes == 1) return {};
    return failure(ErrorCode::kNotFound, "cell {} has no batch {}", cell, id).of("batch").with_text(id);
  });
}

Result<StoredBatch> Store::batch(const std::string& cell, const std::string& id) const {
  return connection_->exclusively([&](SQLite::Database& database) -> Result<StoredBatch> {
    auto row = prepare(
        database,
        "SELECT csv, hash, request_id, accepted_at, poses, job, quarantine FROM batches WHERE cell = ? AND id = ?",
        cell, id);
    if (!row.executeStep())
      return failure(ErrorCode::kNotFound, "cell {} has no batch {}", cell, id).of("batch").with_text(id);
    StoredBatch batch{cell,
                      id,
                      row.getColumn(0).getString(),
                      row.getColumn(1).getString(),
                      row.getColumn(2).getString(),
                      row.getColumn(3).getInt64(),
                      row.getColumn(4).getInt(),
                      row.getColumn(5).getInt64(),
                      row.getColumn(6).getString()};
    if (sha256_hex(batch.csv) != batch.hash) {
      return failure(ErrorCode::kInternal, "batch {} of cell {} is not what was accepted: its hash should be {}", id,
                     cell, batch.hash)
          .in(connection_->path);
    }
    return batch;
  });
}

Result<std::vector<StoredBatch>> Store::batches(const std::string& cell) const {
  return connection_->exclusively([&](SQLite::Database& database) -> Result<std::vector<StoredBatch>> {
    auto rows = prepare(
        database,
        "SELECT id, hash, request_id, accepted_at, poses, job, quarantine FROM batches WHERE cell = ? ORDER BY number",
        cell);
    std::vector<StoredBatch> batches;
    while (rows.executeStep()) {
      batches.push_back({cell, rows.getColumn(0).getString(), "", rows.getColumn(1).getString(),
                         rows.getColumn(2).getString(), rows.getColumn(3).getInt64(), rows.getColumn(4).getInt(),
                         rows.getColumn(5).getInt64(), rows.getColumn(6).getString()});
    }
    return batches;
  });
}

Result<StoredJob> Store::job(std::int64_t id) const {
  return connection_->exclusively([&](SQLite::Database& database) { return read_job(database, id); });
}

Result<std::vector<StoredJob>> Store::unfinished_jobs() const {
  return connection_->exclusively([&](SQLite::Database& database) -> Result<std::vector<StoredJob>> {
    return jobs_of(
        database,
        prepare(database, (std::string(kJobColumns) + "WHERE state IN ('queued', 'running') ORDER BY id").c_str()));
  });
}

Result<std::vector<StoredJob>> Store::recent_jobs(const std::string& cell, int finished) const {
  const std::string wanted = std::string(kJobColumns) +
                             "WHERE (?1 = '' OR cell = ?1) AND (state IN ('queued', 'running') "
                             "OR id IN (SELECT id FROM jobs WHERE (?1 = '' OR cell = ?1) AND state = 'done' "
                             "ORDER BY id DESC LIMIT ?2) "
                             "OR id IN (SELECT id FROM jobs WHERE (?1 = '' OR cell = ?1) AND state = 'failed' "
                             "ORDER BY id DESC LIMIT ?2)) ORDER BY id";
  return connection_->exclusively([&](SQLite::Database& database) -> Result<std::vector<StoredJob>> {
    return jobs_of(database, prepare(database, wanted.c_str(), cell, finished));
  });
}

Status Store::set_job_running(std::int64_t id) {
  return connection_->in_transaction([&](SQLite::Database& database) {
    return changed_one(change(database,
                              "UPDATE jobs SET state = 'running', attempts = attempts + 1 "
                              "WHERE id = ? AND state IN ('queued', 'running')",
                              id),
                       id)
        .map([&] { record_start(database, id); });
  });
}

Status Store::set_job_queued(std::int64_t id) {
  return connection_->in_transaction([&](SQLite::Database& database) {
    return changed_one(change(database,
                              "UPDATE jobs SET state = 'queued', attempts = MAX(attempts - 1, 0) "
                              "WHERE id = ? AND state IN ('queued', 'running')",
                              id),
                       id);
  });
}

Status Store::set_job_failed(std::int64_t id, const std::string& message) {
  return connection_->in_transaction([&](SQLite::Database& database) {
    return changed_one(change(database,
                              "UPDATE jobs SET state = 'failed', message = ? "
                              "WHERE id = ? AND state IN ('queued', 'running')",
                              message, id),
                       id)
        .map([&] { record_end(database, id); });
  });
}

Status Store::set_job_done(std::int64_t id, const std::string& message) {
  return connection_->in_transaction([&](SQLite::Database& database) {
    return changed_one(change(database,
                              "UPDATE jobs SET state = 'done', message = ? "
                              "WHERE id = ? AND state IN ('queued', 'running')",
                              message, id),
                       id)
        .map([&] { record_end(database, id); });
  });
}

Result<int> Store::add_model(const std::string& cell, const CompensatedModel& model, std::int64_t job,
                             bool put_in_force, const std::string& message) {
  const std::string content = serialize(model);
  const ModelProvenance& from = model.provenance();
  const auto& validation = model.parts().validation;
  return connection_->in_transaction([&](SQLite::Database& database) -> Result<int> {
    const int version = next_version(database, cell);
    change(database,
           "INSERT INTO models (cell, version, id, hash, level, batch_id, created_at, training_poses, validation_rms, "
           "content) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
           cell, version, from.id, from.hash, from.level, from.batch_id, now(), from.training_poses,
           validation ? validation->compensated.rms : 0.0, content);
    insert_model_times(database, cell, version, from);
    if (job != 0) {
      const int changes = change(database,
                                 "UPDATE jobs SET state = 'done', model_version = ?, message = ? "
                                 "WHERE id = ? AND cell = ? AND state IN ('queued', 'running')",
                                 version, message, job, cell);
      if (auto status = changed_one(changes, job); !status) return tl::make_unexpected(status.error());
      record_end(database, job);
    }
    if (put_in_force) activate_on_top(database, cell, version);
    return version;
  });
}

Status Store::activate(const std::string& cell, int version) {
  return connection_->in_transaction([&](SQLite::Database& database) -> Status {
    if (!prepare(database, "SELECT 1 FROM models WHERE cell = ? AND version = ?", cell, version).executeStep()) {
      return failure(ErrorCode::kNotFound, "cell {} has no model version {}", cell, version)
          .of("version")
          .with_value(version);
    }
    activate_on_top(database, cell, version);
    return {};
  });
}

Result<std::vector<int>> Store::previous_in_force(const std::string& cell) const {
  return connection_->exclusively([&](SQLite::Database& database) {
    return activations_before(database, cell).map([](const std::vector<Activation>& before) {
      std::vector<int> versions;
      for (const Activation& activation : before) versions.push_back(activation.version);
      return versions;
    });
  });
}

Result<int> Store::rollback(const std::string& cell, int steps) {
  return connection_->in_transaction([&](SQLite::Database& database) -> Result<int> {
    const auto before = activations_before(database, cell);
    if (!before) return tl::make_unexpected(before.error());
    if (steps < 1 || static_cast<std::size_t>(steps) > before->size()) {
      return failure(ErrorCode::kNotFound, "cell {}: {} versions to go back to, not {}", cell, before->size(), steps)
          .of("steps")
          .beyond(steps, steps < 1 ? 1 : before->size());
    }
    const Activation& wanted = (*before)[static_cast<std::size_t>(steps - 1)];
    insert_activation(database, cell, wanted.version, wanted.back);
    return wanted.version;
  });
}

Result<std::vector<StoredModel>> Store::models(const std::string& cell) const {
  return connection_->exclusively([&](SQLite::Database& database) -> Result<std::vector<StoredModel>> {
    const auto present = present_activation(database, cell);
    auto rows = prepare(database,
                        "SELECT version, id, hash, level, batch_id, created_at, training_poses, validation_rms, "
                        "COALESCE(trained_at, created_at), measured_at "
                        "FROM models LEFT JOIN model_times USING (cell, version) WHERE cell = ? ORDER BY version",
                        cell);
    std::vector<StoredModel> models;
    while (rows.executeStep()) {
      StoredModel model;
      model.cell = cell;
      model.version = rows.getColumn(0).getInt();
      model.id = rows.getColumn(1).getString();
      model.hash = rows.getColumn(2).getString();
      model.level = rows.getColumn(3).getString();
      model.batch_id = rows.getColumn(4).getString();
      model.created_at = rows.getColumn(5).getInt64();
      model.training_poses = rows.getColumn(6).getInt();
      model.validation_rms = rows.getColumn(7).getDouble();
      model.in_force = present && present->version == model.version;
      model.trained_at = rows.getColumn(8).getInt64();
      model.measured_at = optional_integer(rows, 9);
      models.push_back(std::move(model));
    }
    return models;
  });
}

Result<CompensatedModel> Store::model(const std::string& cell, int version) const {
  const auto content = connection_->exclusively([&](SQLite::Database& database) -> Result<std::string> {
    auto row = prepare(database, "SELECT content FROM models WHERE cell = ? AND version = ?", cell, version);
    if (!row.executeStep())
      return failure(ErrorCode::kNotFound, "cell {} has no model version {}", cell, version)
          .of("version")
          .with_value(version);
    return row.getColumn(0).getString();
  });
  if (!content) return tl::make_unexpected(content.error());
  return deserialize(*content, fmt::format("{}: model {}@{}", connection_->path, cell, version));
}

Result<std::optional<int>> Store::version_in_force(const std::string& cell) const {
  return connection_->exclusively([&](SQLite::Database& database) -> Result<std::optional<int>> {
    const auto present = present_activation(database, cell);
    return present ? std::optional(present->version) : std::nullopt;
  });
}

}  // namespace trammel
