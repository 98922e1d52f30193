#pragma once

#include <memory>
#include <optional>
#include <string>

#include "server/base/result.h"
#include "server/store/database/sqlite_database.h"
#include "server/store/schema.h"
#include "server/store/served_copies.h"

namespace trammel {

constexpr int kBusyTimeout = 5000;  // ms to wait while another program reads the file

/// A store's file as far as it could be opened.
struct OpenedDatabase {
  std::unique_ptr<SqliteDatabase> file;  ///< null: it is unreadable, and only the copies exist
  std::optional<Error> why_not_written;  ///< set: it can be read at most
};

/// Opens the file for writing; if the disk does not allow that, for reading. If that fails too, and
/// there are copies of its models in force, it opens nothing and the copies are served. Refuses the
/// same as Store::open().
[[nodiscard]] Result<OpenedDatabase> open_database(const std::string& path, ServedCopies& copies);

/// The path as a URI which declares that nobody writes the file.
[[nodiscard]] std::string immutable_uri(const std::string& path);

/// The name for a look at a store that leaves no traces: a store without a journal has no writer,
/// and no journal is created.
[[nodiscard]] std::string uri_to_look_at(const std::string& path);

/// Checks that the file, which this process does not have open, is a store in the state of `mark`
/// (empty: in any state). Looks at the file alone, not at a journal beside it, and changes neither.
[[nodiscard]] Status check_state(const std::string& path, const std::optional<StoreMark>& mark);

}  // namespace trammel
