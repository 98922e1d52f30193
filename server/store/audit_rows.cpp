#include "server/store/audit_rows.h"

#include <utility>

#include "server/base/unix_time.h"
#include "server/store/file_header.h"
#include "server/store/statements.h"

namespace trammel {
namespace {

constexpr int kRowsAtOnce = 2000;  // others use the store in between

constexpr const char* kTables = R"sql(
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

/// How the trail ends, as it was written with its last row.
struct End {
  std::int64_t rows = 0;
  std::string hash;
};

End end_of(SQLite::Database& database) {
  SQLite::Statement row(database, "SELECT rows, hash FROM audit_end");
  if (!row.executeStep()) return {};
  return {row.getColumn(0).getInt64(), row.getColumn(1).getString()};
}

AuditRow row_of(SQLite::Statement& row) {
  const auto text = [&row](int column) { return row.getColumn(column).getString(); };
  return {row.getColumn(0).getInt64(),
          row.getColumn(1).getInt64(),
          text(2),
          text(3),
          text(4),
          text(5),
          text(6),
          text(7),
          text(8),
          text(9),
          text(10),
          text(11)};
}

}  // namespace

void record_audit(SQLite::Database& database, const AuditEntry& entry, const ChangeId& by) {
  const End end = end_of(database);
  AuditRow row{
      end.rows + 1, unix_now(),  by.who.empty() ? "service" : by.who,       entry.cell, entry.what, entry.subject,
      entry.before, entry.after, entry.why.empty() ? by.reason : entry.why, by.id,      end.hash,   {}};
  row.hash = hash_of(row);
  change(database,
         "INSERT INTO audit (number, at, who, cell, what, subject, before, after, why, request, hash_before, hash) "
         "VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
         row.number, row.at, row.who, row.cell, row.what, row.subject, row.before, row.after, row.why, row.request,
         row.hash_before, row.hash);
  change(database, "UPDATE audit_end SET rows = ?, hash = ?", row.number, row.hash);
}

void prepare_audit(SQLite::Database& database, bool is_new, int schema_before) {
  if (database.tableExists("audit")) return;
  database.exec(kTables);
  if (is_new) {
    record_audit(database, {"", "store", "store", "", fmt::format("schema {}", kSchemaVersion)});
    return;
  }
  const auto count = [&database](const char* table) {
    return database.execAndGet(std::string("SELECT COUNT(*) FROM ") + table).getInt64();
  };
  record_audit(database, {"", "migrate", "store", fmt::format("schema {}, no audit trail", schema_before),
                          fmt::format("schema {} with {} batches, {} models, {} activations", kSchemaVersion,
                                      count("batches"), count("models"), count("activations"))});
}

std::int64_t last_audit_at(SQLite::Database& database) {
  try {
    SQLite::Statement row(database, "SELECT at FROM audit ORDER BY number DESC LIMIT 1");
    return row.executeStep() ? row.getColumn(0).getInt64() : 0;
  } catch (const SQLite::Exception&) {
    return 0;
  }
}

std::int64_t audit_rows(SQLite::Database& database) { return end_of(database).rows; }

bool read_more(SQLite::Database& database, const AuditQuery& query, AuditChain& chain, AuditTrail& trail) {
  auto rows = prepare(database,
                      "SELECT number, at, who, cell, what, subject, before, after, why, request, hash_before, hash "
                      "FROM audit WHERE number > ? ORDER BY number LIMIT ?",
                      chain.rows(), kRowsAtOnce);
  bool any = false;
  while (!trail.broken && rows.executeStep()) {
    any = true;
    AuditRow row = row_of(rows);
    if (const Status good = chain.add(row); !good) trail.broken = good.error();
    if (row.at < query.since || (!query.cell.empty() && row.cell != query.cell)) continue;
    trail.rows.push_back(std::move(row));
    if (query.most > 0 && trail.rows.size() > 2 * query.most)
      trail.rows.erase(trail.rows.begin(), trail.rows.end() - static_cast<std::ptrdiff_t>(query.most));
  }
  trail.verified = chain.rows();
  if (any && !trail.broken) return true;
  if (!trail.broken) {
    const End end = end_of(database);
    if (const Status good = chain.end(end.rows, end.hash); !good) trail.broken = good.error();
  }
  if (query.most > 0 && trail.rows.size() > query.most)
    trail.rows.erase(trail.rows.begin(), trail.rows.end() - static_cast<std::ptrdiff_t>(query.most));
  return false;
}

}  // namespace trammel
