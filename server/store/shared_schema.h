#pragma once

#include <string>

#include "server/base/result.h"
#include "server/store/database/database.h"

/// The schema of a store that several servers share, by numbered migrations.
namespace trammel {

/// Refuses (kRefused) a database that is empty, belongs to another program, has an older schema, or
/// has one that is too new for this program. Changes nothing. `place`: for messages.
[[nodiscard]] Status check_shared_schema(Database& database, const std::string& place);

/// Refuses (kRefused) a schema newer than this program's, even if the program can work with it: a
/// copy would lack tables that the program does not know.
[[nodiscard]] Status check_all_is_known(Database& database, const std::string& place);

/// Creates or upgrades the schema of a store in one transaction. Refuses a database of another
/// program or with a newer schema.
[[nodiscard]] Status migrate_shared_schema(Database& database, const std::string& place);

/// Grants a role the use of the store. It may add to the audit trail, but neither change nor delete
/// its rows.
[[nodiscard]] Status grant_shared_store(Database& database, const std::string& role);

}  // namespace trammel
