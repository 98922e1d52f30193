#include "server/store/audit_rows.h"

#include <utility>

#include "server/base/unix_time.h"
#include "server/store/file_header.h"
#include "server/store/schema_text.h"
#include "server/store/statements.h"

namespace trammel {
namespace {

constexpr const char* kEnd = "SELECT rows, hash FROM audit_end";
constexpr int kRowsAtOnce = 2000;  // others use the store in between

/// The end of the trail, as it was written with its last row.
struct End {
  std::int64_t rows = 0;
  std::string hash;
};

End end_of(Database& database, const std::string& sql = kEnd) {
  Rows row = prepare(database, sql.c_str());
  if (!row.next()) return {};
  return {row.integer64(0), row.text(1)};
}

AuditRow row_of(Rows& row) {
  const auto text = [&row](int column) { return row.text(column); };
  return {row.integer64(0), row.integer64(1), text(2), text(3),  text(4),  text(5), text(6),
          text(7),          text(8),          text(9), text(10), text(11), text(12)};
}

}  // namespace

namespace {

/// The previous row is checked in the same statement, since services learn of a moved store only
/// when they connect.
constexpr const char* kAppend =
    "INSERT INTO audit (number, at, who, cell, what, subject, before, after, why, request, "
    "hash_before, hash, server) SELECT CAST($1 AS BIGINT), CAST($2 AS BIGINT), $3, $4, $5, $6, $7, "
    "$8, $9, $10, $11, $12, $13 WHERE $5 = 'reopen' OR NOT EXISTS (SELECT 1 FROM audit WHERE "
    "number = $1 - 1 AND what = 'moved')";

/// Adds a row; false: the store was moved elsewhere. Everybody waits for the end of the trail, so
/// one statement adds the row and notifies the others. They get one notification per transaction.
bool is_added(Database& database, const AuditRow& row) {
  const auto with_row = [&](const auto& run) {
    return run(row.number, row.at, row.who, row.cell, row.what, row.subject, row.before, row.after,
               row.why, row.request, row.hash_before, row.hash, row.server);
  };
  if (database.is_shared()) {
    const std::string at_once = fmt::format(
        "WITH added AS ({} RETURNING number, hash) UPDATE audit_end SET rows = added.number, hash "
        "= added.hash FROM added RETURNING pg_notify('{}', '')",
        kAppend, kChangesChannel);
    return with_row(
        [&](const auto&... values) { return exists(database, at_once.c_str(), values...); });
  }
  if (with_row([&](const auto&... values) { return change(database, kAppend, values...); }) == 0)
    return false;
  change(database, "UPDATE audit_end SET rows = $1, hash = $2", row.number, row.hash);
  return true;
}

void append(Database& database, const AuditEntry& entry, const ChangeId& by) {
  const End end = end_of(database, locked(database, kEnd));
  AuditRow row{end.rows + 1,
               unix_now(),
               by.who.empty() ? "service" : by.who,
               entry.cell,
               entry.what,
               entry.subject,
               entry.before,
               entry.after,
               entry.why.empty() ? by.reason : entry.why,
               by.id,
               end.hash,
               {},
               database.writer()};
  row.hash = hash_of(row);
  if (!is_added(database, row))
    throw DatabaseError(DatabaseError::Kind::kAway,
                        "was moved elsewhere: its audit trail says where to");
}

}  // namespace

void record_audit(Database& database, const AuditEntry& entry, const ChangeId& by) {
  // Every change waits for the end of the trail: it is locked last, and until the commit only.
  database.at_end([entry, by](Database& open) { append(open, entry, by); });
}

bool trail_names_servers(Database& database) {
  return database.is_shared() ||
         integer_of(database,
                    "SELECT COUNT(*) FROM pragma_table_info('audit') WHERE name = 'server'") > 0;
}

void name_servers_in_trail(Database& database) {
  if (!trail_names_servers(database)) database.execute(in_sqlite(kAuditServer));
}

void prepare_audit(Database& database, bool is_new, std::int64_t schema_before) {
  const bool had_trail = database.has_table("audit");
  if (!had_trail) database.execute(in_sqlite(kAuditTables));
  name_servers_in_trail(database);
  if (had_trail) return;
  if (is_new) {
    record_audit(database, {"", "store", "store", "", fmt::format("schema {}", kSchemaVersion)});
    return;
  }
  const auto count = [&database](const char* table) {
    return integer_of(database, (std::string("SELECT COUNT(*) FROM ") + table).c_str());
  };
  record_audit(database,
               {"", "migrate", "store", fmt::format("schema {}, no audit trail", schema_before),
                fmt::format("schema {} with {} batches, {} models, {} activations", kSchemaVersion,
                            count("batches"), count("models"), count("activations"))});
}

std::int64_t last_audit_at(Database& database) {
  try {
    Rows row = prepare(database, "SELECT at FROM audit ORDER BY number DESC LIMIT 1");
    return row.next() ? row.integer64(0) : 0;
  } catch (const DatabaseError&) {
    return 0;
  }
}

std::int64_t audit_rows(Database& database) { return end_of(database).rows; }

bool read_more(Database& database, const AuditQuery& query, AuditChain& chain, AuditTrail& trail) {
  const std::string wanted = fmt::format(
      "SELECT number, at, who, cell, what, subject, before, after, why, request, hash_before, "
      "hash, {} FROM audit WHERE number > $1 ORDER BY number LIMIT $2",
      trail_names_servers(database) ? "server" : "''");
  auto rows = prepare(database, wanted.c_str(), chain.rows(), kRowsAtOnce);
  bool any = false;
  while (!trail.broken && rows.next()) {
    any = true;
    AuditRow row = row_of(rows);
    if (const Status good = chain.add(row); !good) trail.broken = good.error();
    if (row.at < query.since || (!query.cell.empty() && row.cell != query.cell)) continue;
    trail.rows.push_back(std::move(row));
    if (query.most > 0 && trail.rows.size() > 2 * query.most)
      trail.rows.erase(trail.rows.begin(),
                       trail.rows.end() - static_cast<std::ptrdiff_t>(query.most));
  }
  trail.verified = chain.rows();
  if (any && !trail.broken) return true;
  if (!trail.broken) {
    const End end = end_of(database);
    if (const Status good = chain.end(end.rows, end.hash); !good) trail.broken = good.error();
  }
  if (query.most > 0 && trail.rows.size() > query.most)
    trail.rows.erase(trail.rows.begin(),
                     trail.rows.end() - static_cast<std::ptrdiff_t>(query.most));
  return false;
}

}  // namespace trammel
