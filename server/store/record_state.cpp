#include "server/store/commit_safety.h"
#include "server/store/connection.h"
#include "server/store/statements.h"
#include "server/store/store.h"

namespace trammel {
const std::string& Store::server() const { return connection_->worker.server; }

std::string Store::shared_identity() const {
  return is_shared() ? connection_->copies->store() : std::string();
}

RecordState Store::record() const {
  const StoreState now = state();
  RecordState record;
  record.kind = is_shared() ? "postgresql" : "sqlite";
  record.place = connection_->path;
  record.reachable = !now.why_not_written;
  if (!record.reachable) record.away_since = now.since;
  if (!is_shared()) {
    record.survives = "a crash of this host, and not its loss: this host only";
  } else if (record.reachable) {
    static_cast<void>(connection_->exclusively([&record](Database& database) -> Status {
      const CommitSafety safety = safety_of(commit_settings(database));
      record.survives = safety.survives;
      record.worry = safety.worry;
      record.trail_is_safe = !exists(
          database,
          "SELECT 1 WHERE has_table_privilege(current_user, 'audit', 'UPDATE, DELETE, TRUNCATE')");
      return {};
    }));
  }
  return record;
}

}  // namespace trammel
