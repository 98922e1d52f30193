#include "server/store/backup.h"

#include <SQLiteCpp/Backup.h>
#include <sqlite3.h>

#include <filesystem>
#include <system_error>

#include "server/store/file_header.h"
#include "server/store/new_store_file.h"
#include "server/store/open_database.h"
#include "server/store/schema.h"
#include "server/store/statements.h"
#include "server/store/store_texts.h"

namespace trammel {
namespace {

namespace fs = std::filesystem;

constexpr int kPagesAtOnce = 256;  // between two looks at the progress

Status check_is_store(Database& database, const std::string& path) {
  if (integer_of(database, "PRAGMA application_id") == kApplicationId) return {};
  return refused("no store").in(path);
}

Status check_size(Database& database, const std::string& path) {
  const std::int64_t expected =
      integer_of(database, "PRAGMA page_size") * integer_of(database, "PRAGMA page_count");
  std::error_code error;
  const auto size = static_cast<std::int64_t>(fs::file_size(path, error));
  if (!error && size == expected) return {};
  return failure(ErrorCode::kInternal, "damaged: {} bytes, and its pages are {}", size, expected)
      .in(path)
      .next("take an older copy");
}

Result<StoreCopy> checked(Database& database, const std::string& path) {
  TRY(check_is_store(database, path));
  const std::string pages = text_of(database, "PRAGMA integrity_check(1)");
  if (pages != "ok") return failure(ErrorCode::kInternal, "damaged: {}", pages).in(path);
  TRY(check_size(database, path));
  TRY(check_texts(database, path));
  StoreCopy copy;
  if (const auto mark = mark_of(database)) copy.identity = mark->identity;
  copy.models = integer_of(database, "SELECT COUNT(*) FROM models");
  copy.batches = integer_of(database, "SELECT COUNT(*) FROM batches");
  std::error_code error;
  copy.bytes = static_cast<std::int64_t>(fs::file_size(path, error));
  if (!database.has_table("audit")) return copy;  // a store from before the trail
  const auto trail = check_trail(database);
  if (!trail) return Failure(trail.error()).in(path);
  copy.audit_rows = trail->rows;
  copy.audit_hash = trail->hash;
  return copy;
}

/// Copies the state of one moment: the read transaction holds it while it is open.
Status copy_pages(const std::string& from, const std::string& to,
                  const std::function<void(double)>& progress) {
  SqliteDatabase source(uri_to_look_at(from), SQLite::OPEN_READONLY | SQLite::OPEN_URI,
                        kBusyTimeout);
  const Transaction moment(source, Transaction::For::kReading);
  TRY(check_is_store(source, from));
  SqliteDatabase target(to, SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE, kBusyTimeout);
  return with_our_errors([&]() -> Status {
    SQLite::Backup backup(target.file(), source.file());
    while (backup.executeStep(kPagesAtOnce) != SQLITE_DONE) {
      const int total = backup.getTotalPageCount();
      if (progress && total > 0)
        progress(1 - static_cast<double>(backup.getRemainingPageCount()) / total);
    }
    return {};
  });
}

}  // namespace

Result<StoreCopy> back_up_store(const std::string& from, const std::string& to,
                                const std::function<void(double)>& progress) {
  if (std::error_code error; !fs::exists(from, error))
    return failure(ErrorCode::kNotFound, "no such store")
        .in(from)
        .next("its path stands in the server file as store");
  Result<StoreCopy> copy;
  const auto make = [&](const std::string& part) -> Status {
    try {
      TRY(copy_pages(from, part, progress));
      copy = check_store_copy(part);
      return copy.map([](const StoreCopy&) {});
    } catch (const DatabaseError& error) {
      return failure(ErrorCode::kInternal, "cannot be copied to {}: {}", to, error.what()).in(from);
    }
  };
  TRY(make_store_file(to, make));
  return copy;
}

Result<StoreCopy> check_store_copy(const std::string& path) {
  try {
    SqliteDatabase database(immutable_uri(path), SQLite::OPEN_READONLY | SQLite::OPEN_URI,
                            kBusyTimeout);
    return checked(database, path);
  } catch (const DatabaseError& error) {
    return failure(ErrorCode::kInternal, "cannot be read: {}", error.what()).in(path);
  }
}

}  // namespace trammel
