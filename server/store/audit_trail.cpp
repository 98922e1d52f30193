// The trail as it is read: of an open store, and of a file.
#include "server/store/audit.h"
#include "server/store/audit_rows.h"
#include "server/store/connection.h"
#include "server/store/file_header.h"
#include "server/store/open_database.h"
#include "server/store/store.h"

namespace trammel {
namespace {

/// A store's file, to be read only.
Result<AuditTrail> read_all(Database& database, const AuditQuery& query, const std::string& path) {
  if (integer_of(database, "PRAGMA application_id") != kApplicationId) return refused("no store").in(path);
  if (!database.has_table("audit")) return refused("of before there was an audit trail").in(path);
  AuditChain chain;
  AuditTrail trail;
  while (read_more(database, query, chain, trail)) {
  }
  return trail;
}

}  // namespace

Result<AuditTrail> Store::audit(const AuditQuery& query) const {
  AuditChain chain;
  AuditTrail trail;
  for (bool more = true; more;) {
    const auto read = connection_->exclusively(
        [&](Database& database) -> Result<bool> { return read_more(database, query, chain, trail); });
    if (!read) return tl::make_unexpected(read.error());
    more = *read;
  }
  return trail;
}

Result<std::int64_t> Store::changes_made() const {
  return connection_->exclusively([](Database& database) -> Result<std::int64_t> { return audit_rows(database); });
}

Result<AuditTrail> read_audit(const std::string& path, const AuditQuery& query) {
  try {
    SqliteDatabase database(path, SQLite::OPEN_READONLY, kBusyTimeout);
    // One moment of it, while a service goes on writing.
    const Transaction moment(database, Transaction::For::kReading);
    return read_all(database, query, path);
  } catch (const DatabaseError& error) {
    return failure(ErrorCode::kInternal, "cannot be read: {}", error.what()).in(path);
  }
}

}  // namespace trammel
