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
  std::unique_ptr<SqliteDatabase>
      file;  ///< null: nothing of it can be read, and only copies are there
  std::optional<Error> why_not_written;  ///< set: it can be read at most
};

/// Opens the file for writing; where the disk does not let it, for reading; where that fails too
/// and there are copies of the models that it had in force, not at all. Refuses what Store::open()
/// refuses.
[[nodiscard]] Result<OpenedDatabase> open_database(const std::string& path, ServedCopies& copies);

/// The path as a URI that says that nobody writes the file.
[[nodiscard]] std::string immutable_uri(const std::string& path);

/// The name by which a store is opened to be looked at without leaving anything behind: where it
/// has no journal nobody writes it, and none is made.
[[nodiscard]] std::string uri_to_look_at(const std::string& path);

/// Checks that the file, which this process does not have open, is a store in the state of `mark`
/// (empty: in any state). Looks at the file alone, not at a journal beside it, and leaves both as
/// they are.
[[nodiscard]] Status check_state(const std::string& path, const std::optional<StoreMark>& mark);

}  // namespace trammel
