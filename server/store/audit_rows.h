#pragma once

#include <string>

#include "server/store/audit.h"
#include "server/store/change_id.h"
#include "server/store/database/database.h"

/// The audit trail, for the transactions that change something.
namespace trammel {

/// The channel on which a shared database announces new rows of the trail.
constexpr const char* kChangesChannel = "trammel_changes";

/// The effect of a change, as the trail records it.
struct AuditEntry {
  std::string cell, what, subject, before, after;
  std::string why = {};
};

/// Appends the entry to the trail at the end of the open transaction. `by`: the client and the id
/// of its request.
void record_audit(Database& database, const AuditEntry& entry, const ChangeId& by = {});

/// Creates the trail if there is none, and records its beginning.
void prepare_audit(Database& database, bool is_new, std::int64_t schema_before);

/// True if the rows say which server made the change: a file of before does not.
[[nodiscard]] bool trail_names_servers(Database& database);
/// From now on they do.
void name_servers_in_trail(Database& database);

/// When the last row was written, as the clock stood then (Unix time, s); 0: there is none that can
/// be read.
[[nodiscard]] std::int64_t last_audit_at(Database& database);

/// The number of rows of the trail.
[[nodiscard]] std::int64_t audit_rows(Database& database);

/// Reads the next rows into the chain, and those that match the query into the trail; false: there
/// are no more.
[[nodiscard]] bool read_more(Database& database, const AuditQuery& query, AuditChain& chain,
                             AuditTrail& trail);

}  // namespace trammel
