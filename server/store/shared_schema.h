#pragma once

#include <string>

#include "server/base/result.h"
#include "server/store/database/database.h"

/// The schema of a store that several servers share, by numbered migrations.
namespace trammel {

/// Refuses (kRefused) a database that is empty, of another program, of an older schema, or of one
/// that this program is too old for. Changes nothing. `place`: for people.
[[nodiscard]] Status check_shared_schema(Database& database, const std::string& place);

/// Refuses (kRefused) a schema that is newer than this program's, also where the program works on
/// it: tables may hold what it would leave out of a copy.
[[nodiscard]] Status check_all_is_known(Database& database, const std::string& place);

/// Makes an empty database a store of today's schema, and brings an older one up to it, in one
/// transaction. Refuses what is of another program or of a newer schema.
[[nodiscard]] Status migrate_shared_schema(Database& database, const std::string& place);

/// Lets a role use the store. It may add to the audit trail, and neither change nor delete what is
/// in it.
[[nodiscard]] Status grant_shared_store(Database& database, const std::string& role);

}  // namespace trammel
