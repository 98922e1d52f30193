#pragma once

#include <optional>
#include <string>

#include "server/base/result.h"
#include "server/store/database/database.h"

namespace trammel {

inline constexpr const char* kSchemaField = "schema";  // what the error of a newer schema is of

/// Makes an open file a store of today's schema: an empty one gets its tables, an older one what it
/// lacks. Refuses (kRefused) a file of another program or of a newer schema. Does not look for
/// damage: that shows where it is read.
[[nodiscard]] Status prepare_file(Database& database, const std::string& path);
/// For a file that is only read: refuses (kRefused) what prepare_file() refuses and what it would
/// have to change.
[[nodiscard]] Status check_readable(Database& database, const std::string& path);
/// The identity that tells this store from any other one. A store of before it was recorded gets
/// `otherwise`, or a new one.
[[nodiscard]] Result<std::string> identity_of(Database& database, const std::string& otherwise);
/// Tells a state of a store from what it was before and from other stores.
struct StoreMark {
  std::string identity;
  std::string counts;  ///< of all that was ever added, and of jobs that are not finished
};
/// Empty: it cannot be read.
[[nodiscard]] std::optional<StoreMark> mark_of(Database& database);
/// True if any model was ever stored.
[[nodiscard]] bool has_models(Database& database);

}  // namespace trammel
