#pragma once

#include <SQLiteCpp/SQLiteCpp.h>

#include <cstdint>
#include <optional>

namespace trammel {

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
