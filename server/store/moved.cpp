#include "server/store/moved.h"

#include <ctime>

#include "server/store/audit_rows.h"
#include "server/store/statements.h"

namespace trammel {
namespace {

std::string spelled(std::int64_t at) {
  const auto seconds = static_cast<std::time_t>(at);
  std::tm utc{};
  if (::gmtime_r(&seconds, &utc) == nullptr) return std::to_string(at);
  return fmt::format("{:04}-{:02}-{:02}T{:02}:{:02}:{:02}Z", utc.tm_year + 1900, utc.tm_mon + 1,
                     utc.tm_mday, utc.tm_hour, utc.tm_min, utc.tm_sec);
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
      .next(fmt::format("name that one as store; to give it up and go on with this one: trammel "
                        "store reopen '{}'",
                        place));
}

void record_move(Database& database, const std::string& to) {
  name_servers_in_trail(database);
  record_audit(database, {"", kMovedRow, "store", "", to});
}

}  // namespace trammel
