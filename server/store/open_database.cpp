#include "server/store/open_database.h"

#include <array>
#include <exception>
#include <filesystem>
#include <system_error>
#include <utility>

#include "server/store/moved.h"
#include "server/store/schema.h"

namespace trammel {
namespace {

namespace fs = std::filesystem;

/// The result of an attempt to open the file.
struct Attempt {
  std::unique_ptr<SqliteDatabase> file;
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
  } catch (const DatabaseError& error) {
    return {nullptr, failure_of(error, path).value(), error.kind() == DatabaseError::Kind::kAway};
  } catch (const std::exception& error) {
    return {nullptr, failure(ErrorCode::kInternal, "{}", error.what()).in(path).value(), false};
  }
}

/// Judges a file that is missing, empty or not a file. It is damaged if models were served from it;
/// otherwise it is a new store.
Status check_there(const std::string& path, const ServedCopies& copies) {
  std::error_code error;
  const bool exists = fs::exists(path, error);
  if (exists && !fs::is_regular_file(path, error)) return refused("no store: not a file").in(path);
  const bool empty = exists && fs::file_size(path, error) == 0;
  if ((exists && !empty) || copies.stores().empty()) return {};
  return failure(ErrorCode::kInternal, "{}, but models were served from it: their copies are in {}",
                 exists ? "empty" : "not there", copies.root())
      .in(path)
      .next(exists ? "put the store back from a backup, or move both away to begin anew"
                   : "put the store back, or move the copies away to begin anew");
}

/// Gives the copies the store's id. Refuses a store other than the one whose models were served
/// here.
Status check_identity(Database& database, const std::string& path, ServedCopies& copies) {
  const auto known = copies.stores();
  const auto id = TRY(identity_of(database, known.size() == 1 ? known.front() : ""));
  const bool is_known = std::find(known.begin(), known.end(), id) != known.end();
  if (!known.empty() && !is_known && has_models(database)) {
    return failure(ErrorCode::kInternal,
                   "another store than the one that served here, whose copies are in {}",
                   copies.root())
        .in(path)
        .next("put the right one back, or move the copies away if it is meant to be another");
  }
  static_cast<void>(
      copies.belong_to(id, true));  // without the folder there are no copies, but the store works
  return {};
}

Attempt open_for_writing(const std::string& path, ServedCopies& copies) {
  return attempt(path, [&](std::unique_ptr<SqliteDatabase>& file) -> Status {
    TRY(check_there(path, copies));
    file = std::make_unique<SqliteDatabase>(path, SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE,
                                            kBusyTimeout);
    TRY(prepare_file(*file, path));
    TRY(check_not_moved(*file, path));
    return check_identity(*file, path, copies);
  });
}

/// Opens with its journal if possible, otherwise with a journal in memory, otherwise without the
/// journal's content.
Attempt open_for_reading(const std::string& path, ServedCopies& copies) {
  using Open = std::pair<std::string, int>;
  const std::array<Open, 3> ways = {
      {{path, SQLite::OPEN_READONLY},
       {path, SQLite::OPEN_READWRITE},
       {immutable_uri(path), SQLite::OPEN_READONLY | SQLite::OPEN_URI}}};
  Attempt last;
  for (const auto& [name, flags] : ways) {
    last = attempt(path,
                   [&, named = name, how = flags](std::unique_ptr<SqliteDatabase>& file) -> Status {
                     file = std::make_unique<SqliteDatabase>(named, how, kBusyTimeout);
                     if (how == SQLite::OPEN_READWRITE)
                       file->execute("PRAGMA locking_mode = EXCLUSIVE");
                     TRY(check_readable(*file, path));
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
  // A newer program serves it, or it is served elsewhere.
  const bool is_served =
      writing.why_not->field == kSchemaField || writing.why_not->field == kMovedField;
  if (stores.empty() || is_served) return tl::make_unexpected(*writing.why_not);
  static_cast<void>(copies.belong_to(stores.front(), false));
  return OpenedDatabase{nullptr, std::move(writing.why_not)};
}

std::string immutable_uri(const std::string& path) {
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

std::string uri_to_look_at(const std::string& path) {
  std::error_code error;
  const std::string uri = immutable_uri(path);
  return fs::exists(path + "-wal", error) ? uri.substr(0, uri.rfind('?')) : uri;
}

Status check_state(const std::string& path, const std::optional<StoreMark>& mark) {
  const auto wrong = [&path](const std::string& what) {
    return failure(ErrorCode::kBusy, "{}", what)
        .in(path)
        .next(
            "put back the file that was there, or start the service again to go on with what is "
            "there now");
  };
  std::error_code error;
  if (!fs::is_regular_file(path, error)) return wrong("was replaced by what is no file");
  const Attempt look = attempt(path, [&](std::unique_ptr<SqliteDatabase>& file) -> Status {
    file = std::make_unique<SqliteDatabase>(immutable_uri(path),
                                            SQLite::OPEN_READONLY | SQLite::OPEN_URI, kBusyTimeout);
    TRY(check_readable(*file, path));
    const auto is = mark_of(*file);
    if (!mark) return {};
    if (!is) return wrong("was replaced or written over by another program, and cannot be read");
    if (is->identity != mark->identity)
      return wrong("was replaced by another store while it is served from");
    if (is->counts != mark->counts)
      return wrong(
          "was replaced or written over by another state of it, without what was acknowledged "
          "since");
    return {};
  });
  if (look.file) return {};
  if (look.why_not->code == ErrorCode::kBusy && !look.of_the_disk)
    return tl::make_unexpected(*look.why_not);
  return wrong("was replaced or written over by another program: " + look.why_not->message);
}

}  // namespace trammel
