#include "server/store/schema.h"

#include <utility>
#include <vector>

#include "server/store/audit_rows.h"
#include "server/store/file_header.h"
#include "server/store/statements.h"

namespace trammel {
namespace {

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

/// Extra tables beside those of the schema version, so that older programs can still open the file. They hold when jobs
/// began, ended and with what outcome, when models were trained, and when their newest measurement was taken (Unix
/// time, s; NULL = not recorded). They also hold the batches in quarantine that a job may train from; these are
/// released if its model is put in force. Also which jobs are checks of a robot's health, which look like diagnoses to
/// programs that know none. How a version was judged when a person put it in force. And the changes that clients asked
/// for under an id, with what came of them; what of the rest has lost its text; which batches nothing takes any more;
/// and the store's identity. And, of a server among
/// others, which part it has (one row, or none), the batches that models were made of elsewhere, and the highest
/// numbers of versions there.
constexpr const char* kTimes = R"sql(
CREATE TABLE IF NOT EXISTS job_times (
  job         INTEGER PRIMARY KEY REFERENCES jobs (id),
  started_at  INTEGER,
  finished_at INTEGER
);
CREATE TABLE IF NOT EXISTS job_outcomes (
  job         INTEGER PRIMARY KEY REFERENCES jobs (id),
  verdict     TEXT    NOT NULL,
  before_m    REAL,
  after_m     REAL,
  limit_m     REAL,
  code        TEXT    NOT NULL,
  why         TEXT    NOT NULL,
  next_step   TEXT    NOT NULL,
  peak_bytes  INTEGER,
  processor_s REAL
);
CREATE TABLE IF NOT EXISTS job_releases (
  job   INTEGER NOT NULL REFERENCES jobs (id),
  cell  TEXT    NOT NULL,
  batch TEXT    NOT NULL,
  PRIMARY KEY (job, cell, batch),
  FOREIGN KEY (cell, batch) REFERENCES batches (cell, id)
) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS health_checks (job INTEGER PRIMARY KEY REFERENCES jobs (id));
CREATE TABLE IF NOT EXISTS activation_figures (
  number   INTEGER PRIMARY KEY REFERENCES activations (number),
  before_m REAL,
  after_m  REAL,
  limit_m  REAL,
  why      TEXT NOT NULL
);
CREATE TABLE IF NOT EXISTS model_times (
  cell        TEXT    NOT NULL,
  version     INTEGER NOT NULL,
  trained_at  INTEGER NOT NULL,
  measured_at INTEGER,
  PRIMARY KEY (cell, version),
  FOREIGN KEY (cell, version) REFERENCES models (cell, version)
) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS changes (
  number  INTEGER PRIMARY KEY AUTOINCREMENT,
  id      TEXT    NOT NULL UNIQUE,
  asked   TEXT    NOT NULL,
  version INTEGER NOT NULL,
  job     INTEGER NOT NULL,
  made_at INTEGER NOT NULL
);
CREATE TABLE IF NOT EXISTS pruned (
  kind TEXT NOT NULL,
  cell TEXT NOT NULL,
  id   TEXT NOT NULL,
  PRIMARY KEY (kind, cell, id)
) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS discarded (
  cell  TEXT NOT NULL,
  batch TEXT NOT NULL,
  PRIMARY KEY (cell, batch),
  FOREIGN KEY (cell, batch) REFERENCES batches (cell, id)
) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS store_identity (id TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS replica (
  one     INTEGER PRIMARY KEY CHECK (one = 1),
  epoch   INTEGER NOT NULL,
  writes  INTEGER NOT NULL,
  follows TEXT    NOT NULL,
  told    TEXT    NOT NULL
);
CREATE TABLE IF NOT EXISTS learned_elsewhere (
  cell  TEXT NOT NULL,
  batch TEXT NOT NULL,
  PRIMARY KEY (cell, batch),
  FOREIGN KEY (cell, batch) REFERENCES batches (cell, id)
) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS versions_elsewhere (
  cell   TEXT    PRIMARY KEY,
  newest INTEGER NOT NULL
) WITHOUT ROWID;
)sql";

/// The models whose times are not recorded: found from the keys alone, for the rest is large.
constexpr const char* kModelsWithoutTimes =
    "SELECT cell, version FROM models EXCEPT SELECT cell, version FROM model_times";

/// Their times, as far as they can be read.
void fill_in_times(SQLite::Database& database) {
  std::vector<std::pair<std::string, int>> without;
  SQLite::Statement rows(database, kModelsWithoutTimes);
  while (rows.executeStep()) without.emplace_back(rows.getColumn(0).getString(), rows.getColumn(1).getInt());
  for (const auto& [cell, version] : without) {
    change(database,
           "INSERT INTO model_times (cell, version, trained_at) "
           "SELECT cell, version, json_extract(content, '$.stamp.trained_at') FROM models "
           "WHERE cell = ? AND version = ? AND json_valid(content) "
           "AND json_type(content, '$.stamp.trained_at') = 'integer'",
           cell, version);
  }
}

/// In stores of before, the cell of a release is not in the key of its row: there SQLite 3.40 takes it for missing
/// where it checks a copy.
void put_cells_of_releases_into_their_key(SQLite::Database& database) {
  constexpr const char* kOutside =
      "SELECT COUNT(*) FROM pragma_table_info('job_releases') WHERE name = 'cell' AND pk = 0";
  if (database.execAndGet(kOutside).getInt() == 0) return;
  database.exec("ALTER TABLE job_releases RENAME TO job_releases_before");
  database.exec(kTimes);
  database.exec("INSERT INTO job_releases (job, cell, batch) SELECT job, cell, batch FROM job_releases_before");
  database.exec("DROP TABLE job_releases_before");
}

/// Refuses a file that is neither empty nor a store of ours. Changes nothing.
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
        .of(kSchemaField)
        .beyond(schema, kSchemaVersion)
        .next("start a newer one");
  }
  return {};
}

}  // namespace

Status prepare_file(SQLite::Database& database, const std::string& path) {
  if (auto owner = check_owner(database, path); !owner) return owner;
  const std::string mode = database.execAndGet("PRAGMA journal_mode = WAL").getString();
  if (mode != "wal") return failure(ErrorCode::kInternal, "this file system cannot hold a WAL ({})", mode).in(path);
  database.exec("PRAGMA synchronous = FULL");
  database.exec("PRAGMA foreign_keys = ON");
  database.exec("PRAGMA cell_size_check = ON");
  // What is acknowledged is in the file itself, and not in its journal alone: that may get lost.
  database.exec("PRAGMA wal_autocheckpoint = 1");
  const int schema = database.execAndGet("PRAGMA user_version").getInt();
  SQLite::Transaction transaction(database, SQLite::TransactionBehavior::IMMEDIATE);
  if (schema == 0) database.exec(kSchema);
  if (schema < kSchemaVersion) {
    database.exec(kSchemaAdded);
    database.exec(fmt::format("PRAGMA application_id = {}", kApplicationId));
    database.exec(fmt::format("PRAGMA user_version = {}", kSchemaVersion));
  }
  database.exec(kTimes);
  put_cells_of_releases_into_their_key(database);
  fill_in_times(database);
  prepare_audit(database, schema == 0, schema);
  transaction.commit();
  return {};
}

Status check_readable(SQLite::Database& database, const std::string& path) {
  if (auto owner = check_owner(database, path); !owner) return owner;
  const bool has_all = database.tableExists("audit_end") && database.tableExists("versions_elsewhere");
  if (database.execAndGet("PRAGMA user_version").getInt() == kSchemaVersion && has_all) return {};
  return refused("of an older schema, and cannot be written").in(path);
}

Result<std::string> identity_of(SQLite::Database& database, const std::string& otherwise) {
  if (database.tableExists("store_identity")) {
    SQLite::Statement row(database, "SELECT id FROM store_identity");
    if (row.executeStep()) return row.getColumn(0).getString();
  }
  const std::string id = has_models(database) && !otherwise.empty()
                             ? otherwise
                             : database.execAndGet("SELECT lower(hex(randomblob(16)))").getString();
  change(database, "INSERT INTO store_identity (id) VALUES (?)", id);
  return id;
}

std::optional<StoreMark> mark_of(SQLite::Database& database) {
  constexpr const char* kCounts =
      "SELECT (SELECT COALESCE(GROUP_CONCAT(name || ' ' || seq), '') FROM "
      "(SELECT name, seq FROM sqlite_sequence ORDER BY name)) || ', models ' || (SELECT COUNT(*) FROM models) || "
      "', unfinished ' || (SELECT COUNT(*) FROM jobs WHERE state IN ('queued', 'running'))";
  try {
    return StoreMark{database.execAndGet("SELECT id FROM store_identity WHERE id != ''").getString(),
                     database.execAndGet(kCounts).getString()};
  } catch (const SQLite::Exception&) {
    return std::nullopt;
  }
}

bool has_models(SQLite::Database& database) {
  return database.execAndGet("SELECT EXISTS (SELECT 1 FROM models)").getInt() != 0;
}

}  // namespace trammel
