#include "server/store/schema_text.h"

#include <initializer_list>
#include <string_view>
#include <utility>

namespace trammel {
namespace {

void replace_all(std::string& text, std::string_view word, std::string_view by) {
  for (std::size_t at = text.find(word); at != std::string::npos;
       at = text.find(word, at + by.size()))
    text.replace(at, word.size(), by);
}

std::string with(std::string text,
                 std::initializer_list<std::pair<std::string_view, std::string_view>> words) {
  for (const auto& [word, by] : words) replace_all(text, word, by);
  return text;
}

}  // namespace

const char* const kSchema = R"sql(
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
  csv         BYTES   NOT NULL,
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
  content        BYTES   NOT NULL,
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

const char* const kSchemaAdded = R"sql(
ALTER TABLE jobs ADD COLUMN kind TEXT NOT NULL DEFAULT 'train' CHECK (kind IN ('train', 'diagnose'));
ALTER TABLE batches ADD COLUMN quarantine TEXT NOT NULL DEFAULT '';

CREATE TABLE diagnoses (
  job      INTEGER PRIMARY KEY REFERENCES jobs (id),
  csv      BYTES   NOT NULL,
  apply    INTEGER NOT NULL,
  findings BYTES   NOT NULL DEFAULT '',
  page     BYTES   NOT NULL DEFAULT ''
);
)sql";

const char* const kTablesBeside = R"sql(
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
CREATE TABLE IF NOT EXISTS job_claims (
  job          INTEGER PRIMARY KEY REFERENCES jobs (id),
  server       TEXT    NOT NULL,
  token        TEXT    NOT NULL,
  lease_until  INTEGER NOT NULL,
  cancelled_by TEXT
);
CREATE TABLE IF NOT EXISTS cells (
  cell         TEXT    PRIMARY KEY,
  last_version INTEGER NOT NULL
) WITHOUT ROWID;
)sql";

const char* const kTablesGone = R"sql(
DROP TABLE IF EXISTS replica;
DROP TABLE IF EXISTS learned_elsewhere;
DROP TABLE IF EXISTS versions_elsewhere;
)sql";

const char* const kAuditTables = R"sql(
CREATE TABLE audit (
  number      INTEGER PRIMARY KEY,
  at          INTEGER NOT NULL,
  who         TEXT    NOT NULL,
  cell        TEXT    NOT NULL,
  what        TEXT    NOT NULL,
  subject     TEXT    NOT NULL,
  before      TEXT    NOT NULL,
  after       TEXT    NOT NULL,
  why         TEXT    NOT NULL,
  request     TEXT    NOT NULL,
  hash_before TEXT    NOT NULL,
  hash        TEXT    NOT NULL
);
CREATE TABLE audit_end (rows INTEGER NOT NULL, hash TEXT NOT NULL);
INSERT INTO audit_end (rows, hash) VALUES (0, '');
)sql";

const char* const kAuditServer = "ALTER TABLE audit ADD COLUMN server TEXT NOT NULL DEFAULT '';";

const char* const kOutcomeHeldBack =
    "ALTER TABLE job_outcomes ADD COLUMN held_back TEXT NOT NULL DEFAULT '';";

const char* const kCheckTolerance = "ALTER TABLE health_checks ADD COLUMN tolerance_m REAL;";

const char* const kTablesOfServers = R"sql(
CREATE TABLE servers (
  token      TEXT    PRIMARY KEY,
  server     TEXT    NOT NULL,
  host       TEXT    NOT NULL,
  pid        INTEGER NOT NULL,
  program    TEXT    NOT NULL,
  since      INTEGER NOT NULL,
  heard_at   INTEGER NOT NULL,
  serves     INTEGER NOT NULL,
  trains     INTEGER NOT NULL,
  followed   INTEGER NOT NULL,
  cells_json BYTES   NOT NULL
);
CREATE TABLE cell_descriptions (
  number       INTEGER PRIMARY KEY AUTOINCREMENT,
  cell         TEXT    NOT NULL,
  cell_hash    TEXT    NOT NULL,
  robot_hash   TEXT    NOT NULL,
  server       TEXT    NOT NULL,
  described_at INTEGER NOT NULL
);
CREATE INDEX cell_descriptions_by_cell ON cell_descriptions (cell, number);
)sql";

std::string in_sqlite(std::string tables) { return with(std::move(tables), {{"BYTES", "TEXT "}}); }

std::string in_postgres(std::string tables) {
  return with(std::move(tables), {{"INTEGER PRIMARY KEY AUTOINCREMENT",
                                   "BIGINT GENERATED BY DEFAULT AS IDENTITY PRIMARY KEY"},
                                  {"INTEGER", "BIGINT"},
                                  {"REAL", "DOUBLE PRECISION"},
                                  {"BYTES", "BYTEA"},
                                  {" WITHOUT ROWID", ""}});
}

}  // namespace trammel
