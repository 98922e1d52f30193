#include "server/store/store_copy.h"

#include <array>
#include <optional>
#include <utility>

#include "server/store/audit_rows.h"
#include "server/store/database/postgres_database.h"
#include "server/store/database/sqlite_database.h"
#include "server/store/moved.h"
#include "server/store/new_store_file.h"
#include "server/store/open_database.h"
#include "server/store/open_to_read.h"
#include "server/store/schema.h"
#include "server/store/shared_schema.h"
#include "server/store/statements.h"
#include "server/store/store_place.h"
#include "server/store/store_texts.h"
#include "server/store/table_rows.h"
#include "server/store/writer_lock.h"

namespace trammel {
namespace {

using Progress = std::function<void(double)>;

std::int64_t rows_of(Database& database, const char* table) {
  return integer_of(database, fmt::format("SELECT COUNT(*) FROM {}", table).c_str());
}

TableDigest digest_of(Database& database, const StoreTable& table) {
  TableHash hash;
  each_row(database, table, [&](const StoredRow& row) {
    hash.add(row);
    return true;
  });
  return hash.of(table);
}

Status check_pages(Database& database, const std::string& place) {
  if (database.is_shared()) return {};
  const std::string pages = text_of(database, "PRAGMA integrity_check(1)");
  if (pages == "ok") return {};
  return failure(ErrorCode::kInternal, "damaged: {}", pages).in(place);
}

Result<StoreContent> content_of(Database& database, const std::string& place) {
  TRY(check_pages(database, place));
  TRY(check_texts(database, place));
  const auto trail = check_trail(database);
  if (!trail) return Failure(trail.error()).in(place);
  StoreContent content{text_of(database, "SELECT id FROM store_identity WHERE id <> ''"),
                       {},
                       trail->rows,
                       trail->hash};
  for (const StoreTable& table : store_tables()) {
    const TableDigest digest = digest_of(database, table);
    content.tables.push_back({digest.table, digest.rows, digest.hash});
  }
  return content;
}

/// Removes the initial content of a new store.
Status make_room(Database& database, const std::string& place) {
  for (const char* table : {"jobs", "batches", "models"}) {
    if (rows_of(database, table) == 0) continue;
    return refused("is not empty: it has {} {}", rows_of(database, table), table)
        .in(place)
        .next("name an empty database, or a file that is not there");
  }
  for (const char* table : {"audit", "changes", "cells", "store_identity"})
    change(database, fmt::format("DELETE FROM {}", table).c_str());
  return {};
}

/// Sets the number that the next row of its own gets.
void count_on(Database& database) {
  constexpr std::array<std::pair<const char*, const char*>, 4> kCounted = {
      {{"jobs", "id"}, {"batches", "number"}, {"activations", "number"}, {"changes", "number"}}};
  if (!database.is_shared()) return;  // SQLite sees the highest one
  for (const auto& [table, column] : kCounted)
    static_cast<void>(
        integer_of(database, fmt::format("SELECT setval(pg_get_serial_sequence('{0}', '{1}'), "
                                         "COALESCE(MAX({1}), 0) + 1, false) FROM {0}",
                                         table, column)
                                 .c_str()));
}

/// Copies every row, and reads every row again.
Result<StoreContent> fill(Database& source, const std::string& from, Database& target,
                          const std::string& to, const Progress& progress) {
  Transaction transaction(target, Transaction::For::kWriting);
  target.take_long();
  TRY(make_room(target, to));
  std::int64_t total = 1, done = 0;
  for (const StoreTable& table : store_tables()) total += rows_of(source, table.name);
  for (const StoreTable& table : store_tables()) {
    TableHash sent;
    each_row(source, table, [&](const StoredRow& row) {
      insert_row(target, table, row);
      sent.add(row);
      if (progress) progress(static_cast<double>(++done) / static_cast<double>(total));
      return true;
    });
    if (digest_of(target, table) == sent.of(table)) continue;
    return failure(ErrorCode::kInternal, "table {} is not in {} as it is here", table.name, to)
        .in(from);
  }
  Rows end = prepare(source, "SELECT rows, hash FROM audit_end");
  if (end.next())
    change(target, "UPDATE audit_end SET rows = $1, hash = $2", end.integer64(0), end.text(1));
  count_on(target);
  auto content = content_of(target, to);
  if (!content) return content;
  record_audit(target, {"", "copy", "store", from, to});
  transaction.commit();
  return content;
}

Result<StoreContent> copy_to_file(Database& source, const std::string& from, const std::string& to,
                                  const Progress& progress) {
  Result<StoreContent> content;
  const auto make = [&](const std::string& part) -> Status {
    {
      SqliteDatabase target(part, SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE, kBusyTimeout);
      TRY(prepare_file(target, part));
      // The copy is one file, without a journal.
      target.execute("PRAGMA journal_mode = DELETE");
      content = fill(source, from, target, to, progress);
    }
    return content.map([](const StoreContent&) {});
  };
  TRY(make_store_file(to, make));
  return content;
}

Result<StoreContent> copy_to_database(Database& source, const std::string& from,
                                      const std::string& url, const Progress& progress) {
  const std::string to = spoken_place(url);
  const auto target = PostgresDatabase::connect(url, PostgresDatabase::Session::kWrites);
  if (!target) return Failure(target.error()).in(to);
  TRY(migrate_shared_schema(**target, to));
  return fill(source, from, **target, to, progress);
}

Result<StoreContent> copy_to(Database& source, const std::string& from, const std::string& to,
                             const Progress& progress) {
  TRY(source.is_shared() ? check_all_is_known(source, from) : Status());
  return is_postgres_url(to) ? copy_to_database(source, from, to, progress)
                             : copy_to_file(source, from, to, progress);
}

/// Locks the content until the open transaction ends; another process that tries to change it
/// learns who holds the lock.
void keep_as_it_is(Database& database) {
  if (database.is_shared()) database.execute("LOCK TABLE jobs, audit_end IN EXCLUSIVE MODE");
}

/// The copy is whole. A file was only read until now.
void mark_as_moved(Database& source, Transaction& moment, const std::string& from,
                   const std::string& to) {
  if (source.is_shared()) {
    record_move(source, spoken_place(to));
    return moment.commit();
  }
  const auto file = open_to_write(from);
  if (!file) throw DatabaseError(DatabaseError::Kind::kOther, file.error().message);
  Transaction transaction(**file, Transaction::For::kWriting);
  record_move(**file, spoken_place(to));
  transaction.commit();
}

Result<StoreContent> move_store(const std::string& from, const std::string& to,
                                const Progress& progress) {
  const std::string said = spoken_place(from);
  const auto source = TRY(is_postgres_url(from) ? open_to_write(from) : open_to_read(from));
  Transaction moment(*source,
                     source->is_shared() ? Transaction::For::kWriting : Transaction::For::kReading);
  keep_as_it_is(*source);
  source->take_long();
  TRY(check_not_moved(*source, said));
  auto content = copy_to(*source, said, to, progress);
  if (!content) return content;
  try {
    mark_as_moved(*source, moment, from, to);
  } catch (const DatabaseError& error) {
    return failure(ErrorCode::kInternal,
                   "{} is whole, but this one could not be marked as moved there: {}",
                   spoken_place(to), error.what())
        .in(said)
        .next("see that nobody serves this one any more");
  }
  return content;
}

Result<StoreContent> copy_and_keep(const std::string& from, const std::string& to,
                                   const Progress& progress) {
  const auto source = TRY(open_to_read(from));
  const Transaction moment(*source, Transaction::For::kReading);
  source->take_long();
  return copy_to(*source, spoken_place(from), to, progress);
}

}  // namespace

Result<StoreContent> look_through_store(const std::string& place) {
  return look_into(place, [&](Database& database) {
    database.take_long();
    return content_of(database, spoken_place(place));
  });
}

Result<StoreContent> copy_store(const std::string& from, const std::string& to, SourceAfter source,
                                const Progress& progress) {
  std::optional<WriterLock> nobody_writes;
  if (!is_postgres_url(from)) {
    auto lock = TRY(WriterLock::take(from));
    nobody_writes.emplace(std::move(lock));
  }
  try {
    return source == SourceAfter::kMoved ? move_store(from, to, progress)
                                         : copy_and_keep(from, to, progress);
  } catch (const DatabaseError& error) {
    return failure_at(error, from);
  }
}

}  // namespace trammel
