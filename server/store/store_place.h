#pragma once

#include <string>
#include <string_view>

namespace trammel {

/// True if a store's place is a URL of libpq (`postgresql://...`, `postgres://...`) and no file.
[[nodiscard]] bool is_postgres_url(std::string_view place);

/// The place for people, without password and options: `postgresql://trammel@db-1,db-2/trammel`. A
/// file stays as it is.
[[nodiscard]] std::string spoken_place(const std::string& place);

}  // namespace trammel
