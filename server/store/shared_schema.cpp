#include "server/store/shared_schema.h"

#include <vector>

#include "server/store/audit_rows.h"
#include "server/store/schema.h"
#include "server/store/schema_text.h"
#include "server/store/statements.h"

namespace trammel {
namespace {

/// A step from the schema before it to the next one; the first makes all tables. A step that was
/// released stays as it is.
struct Migration {
  std::string statements;
  int works_from;  ///< the oldest schema whose programs also work on this one
};

std::vector<Migration> all_migrations() {
  std::vector<Migration> all = {
      {in_postgres(std::string(kSchema) + kSchemaAdded + kTablesBeside + kAuditTables) +
           "CREATE TABLE trammel_schema (version BIGINT NOT NULL, works_from BIGINT NOT "
           "NULL);INSERT INTO trammel_schema (version, works_from) VALUES (0, 0);INSERT INTO "
           "store_identity (id) VALUES (replace(CAST(gen_random_uuid() AS TEXT), '-', ''));",
       1},
      {std::string(kTablesGone) +
           "CREATE INDEX IF NOT EXISTS jobs_by_cell ON jobs (cell, id);CREATE INDEX IF NOT EXISTS "
           "jobs_failed ON jobs (id) WHERE state = 'failed';",
       2},
      {in_postgres(std::string(kAuditServer) + kTablesOfServers), 3},
      {in_postgres(std::string(kOutcomeHeldBack) + kCheckTolerance), 3}};
#ifdef TRAMMEL_NEXT_SCHEMA
  // The program of the next minor version, for the test of an update that goes from server to
  // server.
  all.push_back(
      {"ALTER TABLE jobs ADD COLUMN colour TEXT NOT NULL DEFAULT '';CREATE TABLE job_colours (job "
       "BIGINT PRIMARY KEY REFERENCES jobs (id));",
       4});
#endif
  return all;
}

const std::vector<Migration>& migrations() {
  static const std::vector<Migration> all = all_migrations();
  return all;
}

std::int64_t newest() { return static_cast<std::int64_t>(migrations().size()); }

bool is_empty(Database& database) {
  return integer_of(database,
                    "SELECT COUNT(*) FROM pg_catalog.pg_class WHERE relkind IN ('r', 'v', 'p') AND "
                    "relnamespace = to_regnamespace(current_schema())") == 0;
}

struct Schema {
  std::int64_t version = 0;
  std::int64_t works_from = 0;
};

Failure too_new(std::int64_t version, const std::string& place) {
  return refused("schema {} is newer than this program's, limit {}", version, newest())
      .in(place)
      .of(kSchemaField)
      .beyond(version, newest())
      .next("start a newer one");
}

/// 0: the database is empty.
Result<Schema> schema_of(Database& database, const std::string& place) {
  if (!database.has_table("trammel_schema")) {
    if (is_empty(database)) return Schema{};
    return refused("a database of another program").in(place).next("name a database of its own");
  }
  Rows row = prepare(database, "SELECT version, works_from FROM trammel_schema");
  if (!row.next()) return refused("its schema has no number").in(place);
  const Schema schema{row.integer64(0), row.integer64(1)};
  if (schema.works_from <= newest()) return schema;
  return too_new(schema.version, place);
}

/// Roles that were let in to use the store before; the owner needs no grant.
std::vector<std::string> roles_let_in(Database& database) {
  Rows rows = prepare(database,
                      "SELECT DISTINCT grantee FROM information_schema.role_table_grants WHERE "
                      "table_schema = current_schema() AND table_name = 'audit' AND privilege_type "
                      "= 'INSERT' AND grantee <> current_user");
  std::vector<std::string> roles;
  while (rows.next()) roles.push_back(rows.text(0));
  return roles;
}

void grant(Database& database, const std::string& role) {
  Rows quoted = prepare(database, "SELECT quote_ident($1), quote_ident(current_schema())", role);
  if (!quoted.next()) return;
  const std::string to = quoted.text(0), in = quoted.text(1);
  database.execute(fmt::format(
      "GRANT USAGE ON SCHEMA {1} TO {0};GRANT SELECT, INSERT, UPDATE, DELETE ON ALL TABLES IN "
      "SCHEMA {1} TO {0};REVOKE UPDATE, DELETE, TRUNCATE ON audit FROM {0};REVOKE INSERT, DELETE, "
      "TRUNCATE ON audit_end FROM {0};REVOKE UPDATE, DELETE, TRUNCATE ON cell_descriptions FROM "
      "{0};REVOKE INSERT, UPDATE, DELETE, TRUNCATE ON trammel_schema FROM {0}",
      to, in));
}

}  // namespace

Status check_shared_schema(Database& database, const std::string& place) {
  const auto schema = TRY(schema_of(database, place));
  const std::string init =
      fmt::format("run trammel store init '{}' as the role that is to own it", place);
  if (schema.version == 0)
    return refused("the database is empty").in(place).of(kSchemaField).next(init);
  if (schema.version >= newest()) return {};
  return refused("schema {} is older than this program's, {}", schema.version, newest())
      .in(place)
      .of(kSchemaField)
      .beyond(schema.version, newest())
      .next(init);
}

Status check_all_is_known(Database& database, const std::string& place) {
  const auto schema = TRY(schema_of(database, place));
  if (schema.version <= newest()) return {};
  return too_new(schema.version, place);
}

Status migrate_shared_schema(Database& database, const std::string& place) {
  Transaction transaction(database, Transaction::For::kWriting);
  constexpr std::int64_t kOneAtATime = 0x5452414D;  // "TRAM"
  static_cast<void>(prepare(database, "SELECT pg_advisory_xact_lock($1)", kOneAtATime));
  const auto schema = TRY(schema_of(database, place));
  for (std::int64_t version = schema.version; version < newest(); ++version) {
    const Migration& step = migrations()[static_cast<std::size_t>(version)];
    database.execute(step.statements);
    change(database, "UPDATE trammel_schema SET version = $1, works_from = $2", version + 1,
           step.works_from);
  }
  // Roles with access to the old tables get access to the new ones.
  if (schema.version > 0 && schema.version < newest()) {
    for (const std::string& role : roles_let_in(database)) grant(database, role);
  }
  if (schema.version < newest())
    record_audit(database, {"", schema.version == 0 ? "store" : "migrate", "store",
                            schema.version == 0 ? "" : fmt::format("schema {}", schema.version),
                            fmt::format("schema {}", newest())});
  transaction.commit();
  return {};
}

namespace {

/// Lets a service see the standbys, so that it can say which failures a change survives. Only some
/// owners can grant this; without the grant, the service says so.
void let_see_standbys(Database& database, const std::string& role) {
  Rows quoted = prepare(database, "SELECT quote_ident($1)", role);
  if (!quoted.next()) return;
  try {
    Transaction transaction(database, Transaction::For::kWriting);
    database.execute(fmt::format("GRANT pg_read_all_stats TO {}", quoted.text(0)));
    transaction.commit();
  } catch (const DatabaseError& error) {
    if (error.kind() != DatabaseError::Kind::kRefused) throw;
  }
}

}  // namespace

Status grant_shared_store(Database& database, const std::string& role) {
  if (text_of(database, "SELECT current_user") == role)
    return refused("role {} owns the store, and could change its audit trail", role)
        .next("grant it to another role");
  Transaction transaction(database, Transaction::For::kWriting);
  grant(database, role);
  transaction.commit();
  let_see_standbys(database, role);
  return {};
}

}  // namespace trammel
