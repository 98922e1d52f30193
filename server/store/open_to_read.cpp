#include "server/store/open_to_read.h"

#include <filesystem>
#include <system_error>

#include "server/store/database/postgres_database.h"
#include "server/store/database/sqlite_database.h"
#include "server/store/file_header.h"
#include "server/store/open_database.h"
#include "server/store/shared_schema.h"
#include "server/store/store_place.h"

namespace trammel {
namespace {

using Session = PostgresDatabase::Session;

Result<std::unique_ptr<Database>> open_url(const std::string& url, Session session) {
  const std::string place = spoken_place(url);
  auto database = PostgresDatabase::connect(url, session);
  if (!database) return Failure(database.error()).in(place);
  TRY(check_shared_schema(**database, place));
  return std::unique_ptr<Database>(std::move(*database));
}

Result<std::unique_ptr<Database>> open_file(const std::string& path, const std::string& name,
                                            int flags) {
  std::error_code error;
  if (!std::filesystem::exists(path, error))
    return failure(ErrorCode::kNotFound, "no such store")
        .in(path)
        .next("its path stands in the server file as store");
  auto file = std::make_unique<SqliteDatabase>(name, flags, kBusyTimeout);
  if (integer_of(*file, "PRAGMA application_id") != kApplicationId)
    return refused("no store").in(path);
  return std::unique_ptr<Database>(std::move(file));
}

}  // namespace

Result<std::unique_ptr<Database>> open_to_read(const std::string& place) {
  if (is_postgres_url(place)) return open_url(place, Session::kMayBeReadOnly);
  return open_file(place, uri_to_look_at(place), SQLite::OPEN_READONLY | SQLite::OPEN_URI);
}

Result<std::unique_ptr<Database>> open_to_write(const std::string& place) {
  if (is_postgres_url(place)) return open_url(place, Session::kWrites);
  auto file = open_file(place, place, SQLite::OPEN_READWRITE);
  if (file) (*file)->execute("PRAGMA synchronous = FULL; PRAGMA wal_autocheckpoint = 1");
  return file;
}

Failure failure_at(const DatabaseError& error, const std::string& place) {
  Failure said = failure_of(error, spoken_place(place));
  if (error.kind() != DatabaseError::Kind::kAgain || !is_postgres_url(place)) return said;
  const auto another = PostgresDatabase::connect(place, Session::kMayBeReadOnly);
  const std::string who = another ? who_holds(**another, Locked::kRows) : "";
  if (!who.empty()) said.value().message += "; " + who;
  return said;
}

}  // namespace trammel
