#include "server/store/backup.h"

#include <SQLiteCpp/Backup.h>
#include <fcntl.h>
#include <sqlite3.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <system_error>

#include "server/base/hash.h"
#include "server/base/part_file.h"
#include "server/compensate/model_file.h"
#include "server/store/audit.h"
#include "server/store/audit_rows.h"
#include "server/store/file_header.h"
#include "server/store/open_database.h"
#include "server/store/schema.h"
#include "server/store/statements.h"

namespace trammel {
namespace {

namespace fs = std::filesystem;

constexpr int kPagesAtOnce = 256;  // between two looks at the progress
constexpr const char* kElsewhere = "name a file that you may write, in a folder with room";

/// Removes the file in which a copy is made; one that is whole has another name by then.
class Unfinished {
 public:
  explicit Unfinished(std::string path) : path_(std::move(path)) {}
  ~Unfinished() {
    std::error_code error;
    fs::remove(path_, error);
  }
  Unfinished(const Unfinished&) = delete;
  Unfinished& operator=(const Unfinished&) = delete;

 private:
  const std::string path_;
};

Status on_disk(const std::string& path) {
  const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  const bool is_there = file >= 0 && ::fsync(file) == 0;
  const int why = errno;
  if (file >= 0) ::close(file);
  if (is_there) return {};
  return failure(ErrorCode::kInternal, "cannot be written to the disk: {}", std::strerror(why))
      .in(path)
      .next(kElsewhere);
}

Status check_is_store(Database& database, const std::string& path) {
  if (integer_of(database, "PRAGMA application_id") == kApplicationId) return {};
  return refused("no store").in(path);
}

/// The trail as a whole, as `read_audit()` verifies it.
Status check_trail(Database& database, StoreCopy& copy) {
  if (!database.has_table("audit")) return {};  // of before there was one
  AuditChain chain;
  AuditTrail trail;
  const AuditQuery last{"", 0, 1};
  while (read_more(database, last, chain, trail)) continue;
  if (trail.broken) return tl::make_unexpected(*trail.broken);
  copy.audit_rows = trail.verified;
  if (!trail.rows.empty()) copy.audit_hash = trail.rows.back().hash;
  return {};
}

Failure damaged(const std::string& what, const std::string& path) {
  return failure(ErrorCode::kInternal, "damaged: {}", what).in(path).next("take an older copy");
}

Status check_size(Database& database, const std::string& path) {
  const std::int64_t expected = integer_of(database, "PRAGMA page_size") * integer_of(database, "PRAGMA page_count");
  std::error_code error;
  const auto size = static_cast<std::int64_t>(fs::file_size(path, error));
  if (!error && size == expected) return {};
  return damaged(fmt::format("{} bytes, and its pages are {}", size, expected), path);
}

/// Every batch is what was accepted; of one that was pruned the text is gone.
Status check_batches(Database& database, const std::string& path) {
  Rows rows = prepare(database, "SELECT cell, id, csv, hash FROM batches WHERE csv <> ''");
  while (rows.next()) {
    if (sha256_hex(rows.text(2)) == rows.text(3)) continue;
    return damaged(fmt::format("batch {} of cell {} is not what was accepted", rows.text(1), rows.text(0)), path);
  }
  return {};
}

/// Every model is what was stored, by its own hashes and by that beside it.
Status check_models(Database& database, const std::string& path) {
  Rows rows = prepare(database, "SELECT cell, version, hash, content FROM models WHERE content <> ''");
  while (rows.next()) {
    const std::string name = fmt::format("version {} of cell {}", rows.integer(1), rows.text(0));
    const auto hash = undamaged_hash(rows.text(3), name);
    if (!hash) return damaged(fmt::format("{}: {}", name, hash.error().message), path);
    if (*hash != rows.text(2)) return damaged(name + " is not the model that was stored", path);
  }
  return {};
}

Status check_texts(Database& database, const std::string& path) {
  const Status batches = check_batches(database, path);
  return batches ? check_models(database, path) : batches;
}

Result<StoreCopy> checked(Database& database, const std::string& path) {
  if (const Status ours = check_is_store(database, path); !ours) return tl::make_unexpected(ours.error());
  const std::string pages = text_of(database, "PRAGMA integrity_check(1)");
  if (pages != "ok") return failure(ErrorCode::kInternal, "damaged: {}", pages).in(path);
  if (const Status whole = check_size(database, path); !whole) return tl::make_unexpected(whole.error());
  if (const Status whole = check_texts(database, path); !whole) return tl::make_unexpected(whole.error());
  StoreCopy copy;
  if (const auto mark = mark_of(database)) copy.identity = mark->identity;
  copy.models = integer_of(database, "SELECT COUNT(*) FROM models");
  copy.batches = integer_of(database, "SELECT COUNT(*) FROM batches");
  std::error_code error;
  copy.bytes = static_cast<std::int64_t>(fs::file_size(path, error));
  if (const Status whole = check_trail(database, copy); !whole) return Failure(whole.error()).in(path);
  return copy;
}

/// Copies one moment of it: what is read is held for as long as the transaction is open.
Status copy_pages(const std::string& from, const std::string& to, const std::function<void(double)>& progress) {
  SqliteDatabase source(uri_to_look_at(from), SQLite::OPEN_READONLY | SQLite::OPEN_URI, kBusyTimeout);
  const Transaction moment(source, Transaction::For::kReading);
  if (const Status ours = check_is_store(source, from); !ours) return ours;
  SqliteDatabase target(to, SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE, kBusyTimeout);
  return with_our_errors([&]() -> Status {
    SQLite::Backup backup(target.file(), source.file());
    while (backup.executeStep(kPagesAtOnce) != SQLITE_DONE) {
      const int total = backup.getTotalPageCount();
      if (progress && total > 0) progress(1 - static_cast<double>(backup.getRemainingPageCount()) / total);
    }
    return {};
  });
}

Status check_is_new(const std::string& path) {
  std::error_code error;
  if (!fs::exists(fs::symlink_status(path, error))) return {};
  return refused("is there already").in(path).next("name another, or move it away");
}

}  // namespace

Result<StoreCopy> back_up_store(const std::string& from, const std::string& to,
                                const std::function<void(double)>& progress) {
  if (const Status is_new = check_is_new(to); !is_new) return tl::make_unexpected(is_new.error());
  if (std::error_code error; !fs::exists(from, error))
    return failure(ErrorCode::kNotFound, "no such store").in(from).next("its path stands in the server file as store");
  remove_leftover_parts(to);
  const std::string part = part_beside(to).string();
  const Unfinished unfinished(part);
  Result<StoreCopy> copy;
  try {
    if (const Status copied = copy_pages(from, part, progress); !copied) return tl::make_unexpected(copied.error());
    copy = check_store_copy(part);
  } catch (const DatabaseError& error) {
    return failure(ErrorCode::kInternal, "cannot be copied to {}: {}", to, error.what()).in(from);
  }
  if (!copy) return copy;
  if (const Status there = on_disk(part); !there) return tl::make_unexpected(there.error());
  if (::link(part.c_str(), to.c_str()) != 0)  // unlike a rename it replaces nothing
    return failure(ErrorCode::kRefused, "cannot be written: {}", std::strerror(errno)).in(to).next(kElsewhere);
  const fs::path folder = fs::path(to).parent_path();
  if (const Status there = on_disk(folder.empty() ? "." : folder.string()); !there)
    return tl::make_unexpected(there.error());
  return copy;
}

Result<StoreCopy> check_store_copy(const std::string& path) {
  try {
    SqliteDatabase database(immutable_uri(path), SQLite::OPEN_READONLY | SQLite::OPEN_URI, kBusyTimeout);
    return checked(database, path);
  } catch (const DatabaseError& error) {
    return failure(ErrorCode::kInternal, "cannot be read: {}", error.what()).in(path);
  }
}

}  // namespace trammel
