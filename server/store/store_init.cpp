#include "server/store/store_init.h"

#include "server/store/database/postgres_database.h"
#include "server/store/open_to_read.h"
#include "server/store/shared_schema.h"
#include "server/store/store_place.h"

namespace trammel {

Status init_store(const std::string& url, const std::string& role) {
  const std::string place = spoken_place(url);
  if (!is_postgres_url(url))
    return refused("is no URL of PostgreSQL")
        .in(place)
        .next("a file needs none of this: the service creates it");
  const auto database = PostgresDatabase::connect(url, PostgresDatabase::Session::kWrites);
  if (!database) return Failure(database.error()).in(place);
  try {
    TRY(migrate_shared_schema(**database, place));
    return role.empty() ? Status() : grant_shared_store(**database, role);
  } catch (const DatabaseError& error) {
    return failure_at(error, url);
  }
}

}  // namespace trammel
