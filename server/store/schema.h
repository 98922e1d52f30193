#pragma once

#include <optional>
#include <string>

#include "server/base/result.h"
#include "server/store/database/database.h"

namespace trammel {

inline constexpr const char* kSchemaField = "schema";  // the field that the error of a newer schema
                                                       // names

/// Brings an open file to the present schema: an empty one gets its tables, an older one its
/// missing tables. Refuses (kRefused) a file of another program or of a newer schema. Does not look
/// for damage, which shows when a row is read.
[[nodiscard]] Status prepare_file(Database& database, const std::string& path);
/// For a file that is only read: refuses (kRefused) in the cases of prepare_file(), and a file that
/// it would have to change.
[[nodiscard]] Status check_readable(Database& database, const std::string& path);
/// The identity that distinguishes this store from all others. A store without a recorded identity
/// gets `otherwise`, or a new one.
[[nodiscard]] Result<std::string> identity_of(Database& database, const std::string& otherwise);
/// Distinguishes a state of a store from its earlier states and from other stores.
struct StoreMark {
  std::string identity;
  std::string counts;  ///< of all rows ever added, and of unfinished jobs
};
/// Empty: it cannot be read.
[[nodiscard]] std::optional<StoreMark> mark_of(Database& database);
/// True if any model was ever stored.
[[nodiscard]] bool has_models(Database& database);

}  // namespace trammel
