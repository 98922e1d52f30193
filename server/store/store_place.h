#pragma once

#include <string>
#include <string_view>

namespace trammel {

/// True if a store's place is what libpq reads (`postgresql://...`, `host=... dbname=...`), or is
/// meant to be, and no file.
[[nodiscard]] bool is_postgres_url(std::string_view place);

/// The place for people, without password and options: `postgresql://trammel@db-1,db-2/trammel`.
/// Nothing is repeated of what libpq cannot read: it may hold a password. A file stays as it is.
[[nodiscard]] std::string spoken_place(const std::string& place);

}  // namespace trammel
