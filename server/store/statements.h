#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "server/store/database/database.h"

namespace trammel {

/// A statement that has rows, with its values bound to $1, $2...
template <typename... Values>
[[nodiscard]] Rows prepare(Database& database, const char* sql, const Values&... values) {
  return database.run(sql, {sql_value(values)...});
}

/// Runs a statement that changes something; returns how many rows it changed.
template <typename... Values>
int change(Database& database, const char* sql, const Values&... values) {
  return database.change(sql, {sql_value(values)...});
}

/// True if the statement has a row.
template <typename... Values>
[[nodiscard]] bool exists(Database& database, const char* sql, const Values&... values) {
  return prepare(database, sql, values...).next();
}

/// The rows that a decision rests on stay as they are until the transaction ends. SQLite locks the
/// whole file.
[[nodiscard]] inline std::string locked(const Database& database, std::string sql) {
  return database.is_shared() ? std::move(sql) + " FOR UPDATE" : std::move(sql);
}

/// Empty where the column is NULL.
[[nodiscard]] inline std::optional<std::int64_t> optional_integer(const Rows& row, int column) {
  if (row.is_null(column)) return std::nullopt;
  return row.integer64(column);
}

[[nodiscard]] inline std::optional<double> optional_number(const Rows& row, int column) {
  if (row.is_null(column)) return std::nullopt;
  return row.number(column);
}

}  // namespace trammel
