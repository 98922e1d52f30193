#include "server/store/reopen.h"

#include <optional>
#include <utility>

#include "server/store/audit_rows.h"
#include "server/store/moved.h"
#include "server/store/open_to_read.h"
#include "server/store/statements.h"
#include "server/store/store_place.h"
#include "server/store/writer_lock.h"

namespace trammel {
namespace {

Status take_up_again(Database& database, const std::string& place) {
  Transaction transaction(database, Transaction::For::kWriting);
  const Status in_use = check_not_moved(database, place);
  if (in_use) return refused("was not moved").in(place).next("start its services");
  if (in_use.error().field != kMovedField) return in_use;
  name_servers_in_trail(database);
  record_audit(database, {"", kReopenedRow, "store", "", place});
  transaction.commit();
  return {};
}

}  // namespace

Status reopen_store(const std::string& place) {
  std::optional<WriterLock> nobody_writes;
  if (!is_postgres_url(place)) {
    auto lock = TRY(WriterLock::take(place));
    nobody_writes.emplace(std::move(lock));
  }
  return work_at(place, open_to_write,
                 [&](Database& database) { return take_up_again(database, spoken_place(place)); });
}

}  // namespace trammel
