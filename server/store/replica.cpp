#include <utility>

#include "server/store/audit_rows.h"
#include "server/store/cell_rows.h"
#include "server/store/connection.h"
#include "server/store/store.h"

// What a server among others remembers of its part.

namespace trammel {
namespace {

std::optional<ReplicaRecord> read_record(Database& database) {
  Rows row = prepare(database, "SELECT epoch, writes, follows, told FROM replica");
  if (!row.next()) return std::nullopt;
  return ReplicaRecord{static_cast<std::uint64_t>(row.integer64(0)), row.truth(1), row.text(2), row.text(3)};
}

std::string spoken(const std::optional<ReplicaRecord>& record) {
  if (!record) return "alone";
  if (record->writes) return "writes";
  return record->follows.empty() ? "follows nobody" : "follows " + record->follows;
}

}  // namespace

Result<ReplicaView> Store::replica_view() const {
  return connection_->exclusively([](Database& database) -> Result<ReplicaView> {
    ReplicaView view{read_record(database), {}, {}};
    Rows rows = prepare(database,
                        "SELECT a.cell, a.version, m.hash FROM "
                        "(SELECT cell, MAX(number) AS number FROM activations GROUP BY cell) AS newest "
                        "JOIN activations AS a USING (number) "
                        "JOIN models AS m ON m.cell = a.cell AND m.version = a.version");
    while (rows.next()) view.cells[rows.text(0)] = {rows.integer(1), rows.text(2)};
    Rows numbers = prepare(database, "SELECT cell, last_version FROM cells");
    while (numbers.next()) view.newest[numbers.text(0)] = numbers.integer(1);
    return view;
  });
}

Status Store::keep_replica_record(const ReplicaRecord& record, const std::string& why) {
  return connection_->in_transaction([&](Database& database) -> Status {
    const auto before = read_record(database);
    if (before == record) return {};
    change(database,
           "INSERT INTO replica (one, epoch, writes, follows, told) VALUES (1, $1, $2, $3, $4) ON CONFLICT (one) DO "
           "UPDATE "
           "SET epoch = excluded.epoch, writes = excluded.writes, follows = excluded.follows, told = excluded.told",
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
  return connection_->in_transaction([&](Database& database) -> Status {
    count_version(database, cell, newest);
    return {};
  });
}

}  // namespace trammel
