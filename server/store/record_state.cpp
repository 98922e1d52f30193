#include "server/store/connection.h"
#include "server/store/statements.h"
#include "server/store/store.h"

namespace trammel {
namespace {

/// By the settings of this connection.
std::string survived_by_commit(Database& database) {
  auto row = prepare(database,
                     "SELECT current_setting('synchronous_commit'), current_setting('synchronous_standby_names'), "
                     "current_setting('fsync')");
  if (!row.next()) return "";
  const std::string commit = row.text(0), standbys = row.text(1);
  if (row.text(2) != "on") return "the end of the servers, and no crash of the database's host: fsync is off";
  if (commit == "off") return "the end of the servers, and no crash of the database's host: synchronous_commit is off";
  if (standbys.empty() || commit == "local") return "a crash of the database's host, and not its loss: this host only";
  return fmt::format("the loss of the database's host: the standbys {} have it, too", standbys);
}

}  // namespace

const std::string& Store::server() const { return connection_->worker.server; }

std::string Store::shared_identity() const { return is_shared() ? connection_->copies->store() : std::string(); }

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
    record.survives =
        connection_->exclusively([](Database& database) -> Result<std::string> { return survived_by_commit(database); })
            .value_or("");
  }
  return record;
}

}  // namespace trammel
