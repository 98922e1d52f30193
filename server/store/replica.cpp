#include <utility>

#include "server/store/audit_rows.h"
#include "server/store/connection.h"
#include "server/store/store.h"

// What a server among others remembers of its part.

namespace trammel {
namespace {

std::optional<ReplicaRecord> read_record(SQLite::Database& database) {
  SQLite::Statement row(database, "SELECT epoch, writes, follows, told FROM replica");
  if (!row.executeStep()) return std::nullopt;
  return ReplicaRecord{static_cast<std::uint64_t>(row.getColumn(0).getInt64()), row.getColumn(1).getInt() != 0,
                       row.getColumn(2).getString(), row.getColumn(3).getString()};
}

std::string spoken(const std::optional<ReplicaRecord>& record) {
  if (!record) return "alone";
  if (record->writes) return "writes";
  return record->follows.empty() ? "follows nobody" : "follows " + record->follows;
}

}  // namespace

Result<ReplicaView> Store::replica_view() const {
  return connection_->exclusively([](SQLite::Database& database) -> Result<ReplicaView> {
    ReplicaView view{read_record(database), {}, {}};
    SQLite::Statement rows(database,
                           "SELECT a.cell, a.version, m.hash FROM "
                           "(SELECT cell, MAX(number) AS number FROM activations GROUP BY cell) AS newest "
                           "JOIN activations AS a USING (number) "
                           "JOIN models AS m ON m.cell = a.cell AND m.version = a.version");
    while (rows.executeStep())
      view.cells[rows.getColumn(0).getString()] = {rows.getColumn(1).getInt(), rows.getColumn(2).getString()};
    SQLite::Statement numbers(database,
                              "SELECT cell, MAX(number) FROM (SELECT cell, MAX(version) AS number FROM models "
                              "GROUP BY cell UNION ALL SELECT cell, newest FROM versions_elsewhere) GROUP BY cell");
    while (numbers.executeStep()) view.newest[numbers.getColumn(0).getString()] = numbers.getColumn(1).getInt();
    return view;
  });
}

Status Store::keep_replica_record(const ReplicaRecord& record, const std::string& why) {
  return connection_->in_transaction([&](SQLite::Database& database) -> Status {
    const auto before = read_record(database);
    if (before == record) return {};
    change(database, "INSERT OR REPLACE INTO replica (one, epoch, writes, follows, told) VALUES (1, ?, ?, ?, ?)",
           static_cast<std::int64_t>(record.epoch), record.writes ? 1 : 0, record.follows, record.told);
    if (spoken(before) != spoken(record))
      record_audit(database, {"", "replica", "part", spoken(before), spoken(record), why});
    return {};
  });
}

Status Store::number_after(const std::string& cell, int newest) {
  if (newest > kHighestTold)
    return refused("cell {}: version {} of another server, limit {}", cell, newest, kHighestTold)
        .of("version")
        .beyond(newest, kHighestTold);
  return connection_->in_transaction([&](SQLite::Database& database) -> Status {
    change(database,
           "INSERT INTO versions_elsewhere (cell, newest) VALUES (?, ?) "
           "ON CONFLICT (cell) DO UPDATE SET newest = MAX(newest, excluded.newest)",
           cell, newest);
    return {};
  });
}

}  // namespace trammel
