#include "server/store/moved.h"

#include <ctime>

#include "server/store/audit_rows.h"
#include "server/store/open_to_read.h"
#include "server/store/statements.h"
#include "server/store/store_place.h"
#include "server/store/writer_lock.h"

namespace trammel {
namespace {

std::string spelled(std::int64_t at) {
  const auto seconds = static_cast<std::time_t>(at);
  std::tm utc{};
  if (::gmtime_r(&seconds, &utc) == nullptr) return std::to_string(at);
  return fmt::format("{:04}-{:02}-{:02}T{:02}:{:02}:{:02}Z", utc.tm_year + 1900, utc.tm_mon + 1, utc.tm_mday,
                     utc.tm_hour, utc.tm_min, utc.tm_sec);
}

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

Status check_not_moved(Database& database, const std::string& place) {
  std::int64_t at = 0;
  std::string to;
  try {
    if (!database.has_table("audit")) return {};
    Rows last = prepare(database, "SELECT what, at, after FROM audit ORDER BY number DESC LIMIT 1");
    if (!last.next() || last.text(0) != kMovedRow) return {};
    at = last.integer64(1);
    to = last.text(2);
  } catch (const DatabaseError& error) {
    if (error.kind() != DatabaseError::Kind::kOther) throw;
    return {};
  }
  return refused("was moved to {} at {}", to, spelled(at))
      .in(place)
      .of(kMovedField)
      .next(fmt::format("name that one as store; to give it up and go on with this one: trammel store reopen '{}'",
                        place));
}

void record_move(Database& database, const std::string& to) {
  name_servers_in_trail(database);
  record_audit(database, {"", kMovedRow, "store", "", to});
}

Status reopen_store(const std::string& place) {
  const std::string said = spoken_place(place);
  std::optional<WriterLock> nobody_writes;
  if (!is_postgres_url(place)) {
    auto lock = WriterLock::take(place);
    if (!lock) return tl::make_unexpected(lock.error());
    nobody_writes.emplace(std::move(*lock));
  }
  try {
    const auto database = open_to_write(place);
    return database ? take_up_again(**database, said) : tl::make_unexpected(database.error());
  } catch (const DatabaseError& error) {
    return failure_of(error, said);
  }
}

}  // namespace trammel
