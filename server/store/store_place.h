#pragma once

#include <string>
#include <string_view>

namespace trammel {

/// True if a store's place is a database in libpq's form (`postgresql://...`, `host=...
/// dbname=...`), or resembles one, and is no file.
[[nodiscard]] bool is_postgres_url(std::string_view place);

/// The place for people, without password and options: `postgresql://trammel@db-1,db-2/trammel`.
/// Text that libpq cannot read is not repeated, because it may contain a password. A file name
/// stays unchanged.
[[nodiscard]] std::string spoken_place(const std::string& place);

}  // namespace trammel
