#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "server/store/database/database.h"

/// The tables of a store row by row, whatever the database, a few rows at a time.
namespace trammel {

struct StoreColumn {
  enum class Kind { kInteger, kNumber, kBytes };
  const char* name;
  Kind kind;
};

struct StoreTable {
  const char* name;
  int keys;  ///< the number of leading columns that identify a row
  std::vector<StoreColumn> columns;
};

/// The tables that are moved with a store, referenced ones first. Excluded are the present servers
/// and their claims, the descriptions of cells, and the end of the audit trail.
[[nodiscard]] const std::vector<StoreTable>& store_tables();

/// NULL, or the value of the column.
using StoredValue = std::variant<std::nullptr_t, std::int64_t, double, std::string>;
using StoredRow = std::vector<StoredValue>;

/// Calls `visit` for each row, by its key; false ends it.
void each_row(Database& database, const StoreTable& table,
              const std::function<bool(const StoredRow&)>& visit);
void insert_row(Database& database, const StoreTable& table, const StoredRow& row);

/// The number of rows, and a SHA-256 that any change of any row changes. The order of the rows does
/// not matter, since databases sort texts differently.
struct TableDigest {
  std::string table;
  std::int64_t rows = 0;
  std::string hash;
  bool operator==(const TableDigest&) const = default;
};

class TableHash {
 public:
  void add(const StoredRow& row);
  [[nodiscard]] TableDigest of(const StoreTable& table) const;

 private:
  std::int64_t rows_ = 0;
  std::vector<std::uint8_t> sum_ = std::vector<std::uint8_t>(32, 0);
};

}  // namespace trammel
