#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <exception>
#include <optional>
#include <string>
#include <utility>

#include "server/base/mutex.h"
#include "server/base/result.h"
#include "server/store/writer_lock.h"

namespace trammel {

constexpr int kBusyTimeout = 5000;  // ms to wait while another program reads the file

/// One connection behind one lock.
struct StoreConnection {
  StoreConnection(std::string file, WriterLock writer)
      : path(std::move(file)),
        lock(std::move(writer)),
        database(path, SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE, kBusyTimeout) {}

  /// Runs `work(database)` with the lock held. An exception of SQLite becomes kInternal.
  template <typename Work>
  auto exclusively(const Work& work) -> decltype(work(std::declval<SQLite::Database&>())) {
    const MutexLock guard(mutex);
    try {
      return work(database);
    } catch (const SQLite::Exception& error) {
      return failure(ErrorCode::kInternal, "{} (SQLite error {})", error.what(), error.getExtendedErrorCode()).in(path);
    } catch (const std::exception& error) {
      return failure(ErrorCode::kInternal, "{}", error.what()).in(path);
    }
  }

  /// The same in one transaction, committed only if `work` succeeds.
  template <typename Work>
  auto in_transaction(const Work& work) -> decltype(work(std::declval<SQLite::Database&>())) {
    return exclusively([&work](SQLite::Database& open) {
      SQLite::Transaction transaction(open, SQLite::TransactionBehavior::IMMEDIATE);
      auto result = work(open);
      if (result) transaction.commit();
      return result;
    });
  }

  const std::string path;
  const WriterLock lock;
  Mutex mutex;
  SQLite::Database database TRAMMEL_GUARDED_BY(mutex);
};

/// A prepared statement with its values bound in order.
template <typename... Values>
[[nodiscard]] SQLite::Statement prepare(SQLite::Database& database, const char* sql, const Values&... values) {
  SQLite::Statement statement(database, sql);
  int index = 0;
  (statement.bind(++index, values), ...);
  return statement;
}

/// Runs a statement that changes something; returns how many rows it changed.
template <typename... Values>
int change(SQLite::Database& database, const char* sql, const Values&... values) {
  return prepare(database, sql, values...).exec();
}

/// Empty where the column is NULL.
[[nodiscard]] inline std::optional<std::int64_t> optional_integer(SQLite::Statement& row, int column) {
  if (row.isColumnNull(column)) return std::nullopt;
  return row.getColumn(column).getInt64();
}

[[nodiscard]] inline std::optional<double> optional_number(SQLite::Statement& row, int column) {
  if (row.isColumnNull(column)) return std::nullopt;
  return row.getColumn(column).getDouble();
}

}  // namespace trammel
