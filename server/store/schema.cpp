#include "server/store/schema.h"

#include <utility>
#include <vector>

#include "server/store/audit_rows.h"
#include "server/store/file_header.h"
#include "server/store/schema_text.h"
#include "server/store/statements.h"

namespace trammel {
namespace {

/// The models without recorded times. The query reads only the keys, because the rest is large.
constexpr const char* kModelsWithoutTimes =
    "SELECT cell, version FROM models EXCEPT SELECT cell, version FROM model_times";

/// Also counts versions that older programs added. Those programs do not count them.
constexpr const char* kCountVersions =
    "INSERT INTO cells (cell, last_version) SELECT cell, MAX({1}) FROM {0} WHERE true GROUP BY "
    "cell ON CONFLICT (cell) DO UPDATE SET last_version = excluded.last_version WHERE "
    "excluded.last_version > cells.last_version";

/// Only a read of damaged data must fail, not every read.
void execute_unless_damaged(Database& database, const std::string& statements) {
  try {
    database.execute(statements);
  } catch (const DatabaseError& error) {
    if (error.kind() != DatabaseError::Kind::kOther) throw;
  }
}

/// A version number stays taken if another server gave it while this server followed that one.
void count_versions(Database& database) {
  execute_unless_damaged(database, fmt::format(kCountVersions, "models", "version"));
  if (database.has_table("versions_elsewhere"))
    execute_unless_damaged(database, fmt::format(kCountVersions, "versions_elsewhere", "newest"));
}

/// Adds the training times of stored models, as far as the models can be read.
void fill_in_times(Database& database) {
  std::vector<std::pair<std::string, int>> without;
  Rows rows = prepare(database, kModelsWithoutTimes);
  while (rows.next()) without.emplace_back(rows.text(0), rows.integer(1));
  for (const auto& [cell, version] : without) {
    change(database,
           "INSERT INTO model_times (cell, version, trained_at) SELECT cell, version, "
           "json_extract(content, '$.stamp.trained_at') FROM models WHERE cell = $1 AND version = "
           "$2 AND json_valid(content) AND json_type(content, '$.stamp.trained_at') = 'integer'",
           cell, version);
  }
}

/// In older stores the cell of a release is not in the key of its row, and SQLite 3.40 then reports
/// it as missing when it checks a copy.
void put_cells_of_releases_into_their_key(Database& database) {
  constexpr const char* kOutside =
      "SELECT COUNT(*) FROM pragma_table_info('job_releases') WHERE name = 'cell' AND pk = 0";
  if (integer_of(database, kOutside) == 0) return;
  database.execute("ALTER TABLE job_releases RENAME TO job_releases_before");
  database.execute(in_sqlite(kTablesBeside));
  database.execute(
      "INSERT INTO job_releases (job, cell, batch) SELECT job, cell, batch FROM "
      "job_releases_before");
  database.execute("DROP TABLE job_releases_before");
}

bool has_column(Database& database, const char* table, const char* column) {
  return exists(database, "SELECT 1 FROM pragma_table_info($1) WHERE name = $2", table, column);
}

/// Refuses a file that is neither empty nor a store of ours. Changes nothing.
Status check_owner(Database& database, const std::string& path) {
  const std::int64_t application = integer_of(database, "PRAGMA application_id");
  const std::int64_t schema = integer_of(database, "PRAGMA user_version");
  const bool empty = integer_of(database, "SELECT COUNT(*) FROM sqlite_master") == 0;
  if (empty && application == 0 && schema == 0) return {};
  if (application != kApplicationId) {
    return refused("a database of another program (application id {:#x}, not {:#x})", application,
                   kApplicationId)
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

Status prepare_file(Database& database, const std::string& path) {
  TRY(check_owner(database, path));
  const std::string mode = text_of(database, "PRAGMA journal_mode = WAL");
  if (mode != "wal")
    return failure(ErrorCode::kInternal, "this file system cannot hold a WAL ({})", mode).in(path);
  database.execute("PRAGMA synchronous = FULL");
  database.execute("PRAGMA foreign_keys = ON");
  database.execute("PRAGMA cell_size_check = ON");
  // Acknowledged changes are in the file itself, and not in its journal alone: that may get lost.
  database.execute("PRAGMA wal_autocheckpoint = 1");
  const std::int64_t schema = integer_of(database, "PRAGMA user_version");
  Transaction transaction(database, Transaction::For::kWriting);
  if (schema == 0) database.execute(in_sqlite(kSchema));
  if (schema < kSchemaVersion) {
    database.execute(in_sqlite(kSchemaAdded));
    database.execute(fmt::format("PRAGMA application_id = {}", kApplicationId));
    database.execute(fmt::format("PRAGMA user_version = {}", kSchemaVersion));
  }
  database.execute(in_sqlite(kTablesBeside));
  if (!has_column(database, "job_outcomes", "held_back"))
    database.execute(in_sqlite(kOutcomeHeldBack));
  if (!has_column(database, "health_checks", "tolerance_m"))
    database.execute(in_sqlite(kCheckTolerance));
  put_cells_of_releases_into_their_key(database);
  fill_in_times(database);
  count_versions(database);
  execute_unless_damaged(database, kTablesGone);
  prepare_audit(database, schema == 0, schema);
  transaction.commit();
  return {};
}

Status check_readable(Database& database, const std::string& path) {
  TRY(check_owner(database, path));
  const bool has_all = database.has_table("audit_end") && database.has_table("cells") &&
                       database.has_table("job_claims") &&
                       has_column(database, "job_outcomes", "held_back") &&
                       has_column(database, "health_checks", "tolerance_m");
  if (integer_of(database, "PRAGMA user_version") == kSchemaVersion && has_all) return {};
  return refused("of an older schema, and cannot be written").in(path);
}

Result<std::string> identity_of(Database& database, const std::string& otherwise) {
  if (database.has_table("store_identity")) {
    Rows row = prepare(database, "SELECT id FROM store_identity");
    if (row.next()) return row.text(0);
  }
  const std::string id = has_models(database) && !otherwise.empty()
                             ? otherwise
                             : text_of(database, "SELECT lower(hex(randomblob(16)))");
  change(database, "INSERT INTO store_identity (id) VALUES ($1)", id);
  return id;
}

std::optional<StoreMark> mark_of(Database& database) {
  constexpr const char* kCounts =
      "SELECT (SELECT COALESCE(GROUP_CONCAT(name || ' ' || seq), '') FROM (SELECT name, seq FROM "
      "sqlite_sequence ORDER BY name)) || ', models ' || (SELECT COUNT(*) FROM models) || ', "
      "unfinished ' || (SELECT COUNT(*) FROM jobs WHERE state IN ('queued', 'running'))";
  try {
    return StoreMark{text_of(database, "SELECT id FROM store_identity WHERE id != ''"),
                     text_of(database, kCounts)};
  } catch (const DatabaseError&) {
    return std::nullopt;
  }
}

bool has_models(Database& database) { return exists(database, "SELECT 1 FROM models LIMIT 1"); }

}  // namespace trammel
