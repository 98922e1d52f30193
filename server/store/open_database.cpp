#include "server/store/open_database.h"

#include <sqlite3.h>

#include <array>
#include <exception>
#include <filesystem>
#include <system_error>
#include <utility>

#include "server/store/schema.h"

namespace trammel {
namespace {

namespace fs = std::filesystem;

/// What an attempt to open the file came to.
struct Attempt {
  std::unique_ptr<SQLite::Database> file;
  std::optional<Error> why_not;
  bool of_the_disk = false;
};

template <typename Open>
Attempt attempt(const std::string& path, const Open& open) {
  try {
    Attempt made;
    const Status ready = open(made.file);
    if (!ready) return {nullptr, ready.error(), false};
    return made;
  } catch (const SQLite::Exception& error) {
    return {nullptr, failure_of(error, path).value(), is_of_the_disk(error)};
  } catch (const std::exception& error) {
    return {nullptr, failure(ErrorCode::kInternal, "{}", error.what()).in(path).value(), false};
  }
}

bool is_empty(const std::string& path) {
  std::error_code error;
  return fs::exists(path, error) && fs::file_size(path, error) == 0;
}

/// A file that is empty where models were served from it is damaged; one that is not there is a new beginning.
Status check_not_emptied(const std::string& path, const ServedCopies& copies) {
  if (!is_empty(path) || copies.stores().empty()) return {};
  return failure(ErrorCode::kInternal, "empty, but models were served from it: their copies are in {}", copies.root())
      .in(path)
      .next("put the store back from a backup, or move both away to begin anew");
}

/// Gives the copies the store's id. Refuses a store that is not the one whose models were served here.
Status check_identity(SQLite::Database& database, const std::string& path, ServedCopies& copies) {
  const auto known = copies.stores();
  const auto id = identity_of(database, known.size() == 1 ? known.front() : "");
  if (!id) return tl::make_unexpected(id.error());
  const bool is_known = std::find(known.begin(), known.end(), *id) != known.end();
  if (!known.empty() && !is_known && has_models(database)) {
    return failure(ErrorCode::kInternal, "another store than the one that served here, whose copies are in {}",
                   copies.root())
        .in(path)
        .next("put the right one back, or move the copies away if it is meant to be another");
  }
  static_cast<void>(copies.belong_to(*id, true));  // without the folder there are no copies: the store goes on
  return {};
}

Attempt open_for_writing(const std::string& path, ServedCopies& copies) {
  return attempt(path, [&](std::unique_ptr<SQLite::Database>& file) -> Status {
    if (auto fine = check_not_emptied(path, copies); !fine) return fine;
    file = std::make_unique<SQLite::Database>(path, SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE, kBusyTimeout);
    if (auto ready = prepare_file(*file, path); !ready) return ready;
    return check_identity(*file, path, copies);
  });
}

/// The path as a URI that says that nobody writes the file.
std::string immutable(const std::string& path) {
  std::string uri = "file:";
  for (const char c : path) {
    if (c == '%' || c == '?' || c == '#') {
      uri += fmt::format("%{:02X}", static_cast<unsigned char>(c));
    } else {
      uri += c;
    }
  }
  return uri + "?immutable=1";
}

/// With its journal where that can be had, with one in memory, or without what the journal holds.
Attempt open_for_reading(const std::string& path, ServedCopies& copies) {
  using Open = std::pair<std::string, int>;
  const std::array<Open, 3> ways = {{{path, SQLite::OPEN_READONLY},
                                     {path, SQLite::OPEN_READWRITE},
                                     {immutable(path), SQLite::OPEN_READONLY | SQLite::OPEN_URI}}};
  Attempt last;
  for (const auto& [name, flags] : ways) {
    last = attempt(path, [&, named = name, how = flags](std::unique_ptr<SQLite::Database>& file) -> Status {
      file = std::make_unique<SQLite::Database>(named, how, kBusyTimeout);
      if (how == SQLite::OPEN_READWRITE) file->exec("PRAGMA locking_mode = EXCLUSIVE");
      if (auto ours = check_readable(*file, path); !ours) return ours;
      return check_identity(*file, path, copies);
    });
    if (last.file) return last;
  }
  return last;
}

}  // namespace

Result<OpenedDatabase> open_database(const std::string& path, ServedCopies& copies) {
  Attempt writing = open_for_writing(path, copies);
  if (writing.file) return OpenedDatabase{std::move(writing.file), std::nullopt};
  if (writing.of_the_disk) {
    Attempt reading = open_for_reading(path, copies);
    if (reading.file) return OpenedDatabase{std::move(reading.file), std::move(writing.why_not)};
  }
  const auto stores = copies.stores();
  const bool is_newer = writing.why_not->field == kSchemaField;  // a newer program serves it
  if (stores.empty() || is_newer) return tl::make_unexpected(*writing.why_not);
  static_cast<void>(copies.belong_to(stores.front(), false));
  return OpenedDatabase{nullptr, std::move(writing.why_not)};
}

bool is_of_the_disk(const SQLite::Exception& error) {
  switch (error.getErrorCode()) {
    case SQLITE_FULL:
    case SQLITE_IOERR:
    case SQLITE_READONLY:
    case SQLITE_CANTOPEN:
    case SQLITE_PERM:
    case SQLITE_PROTOCOL:
      return true;
    default:
      return false;
  }
}

Failure failure_of(const SQLite::Exception& error, const std::string& path) {
  Failure said = failure(is_of_the_disk(error) ? ErrorCode::kBusy : ErrorCode::kInternal, "{} (SQLite error {})",
                         error.what(), error.getExtendedErrorCode())
                     .in(path);
  if (!is_of_the_disk(error)) return said;
  return std::move(said).next("it is tried again by itself; ask again later");
}

}  // namespace trammel
