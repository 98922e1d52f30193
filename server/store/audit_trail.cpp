// Reads the trail of an open store, and of a store that services use.
#include "server/store/audit.h"
#include "server/store/audit_rows.h"
#include "server/store/connection.h"
#include "server/store/open_to_read.h"
#include "server/store/store.h"
#include "server/store/store_place.h"

namespace trammel {
namespace {

/// Verified as a whole.
Result<AuditTrail> read_all(Database& database, const AuditQuery& query, const std::string& place) {
  if (!database.has_table("audit")) return refused("of before there was an audit trail").in(place);
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
    const auto read = TRY(connection_->exclusively([&](Database& database) -> Result<bool> {
      return read_more(database, query, chain, trail);
    }));
    more = read;
  }
  return trail;
}

Result<std::int64_t> Store::changes_made() const {
  return connection_->exclusively(
      [](Database& database) -> Result<std::int64_t> { return audit_rows(database); });
}

Result<AuditTrail> read_audit(const std::string& place, const AuditQuery& query) {
  return look_into(
      place, [&](Database& database) { return read_all(database, query, spoken_place(place)); });
}

}  // namespace trammel
