#include "server/store/cell_rows.h"

#include <limits>

#include "server/store/statements.h"

namespace trammel {

void lock_cell(Database& database, const std::string& cell) {
  if (!database.is_shared()) return;  // the transaction has the whole file
  constexpr const char* kRow = "SELECT 1 FROM cells WHERE cell = $1 FOR UPDATE";
  if (exists(database, kRow, cell)) return;
  change(database,
         "INSERT INTO cells (cell, last_version) VALUES ($1, 0) ON CONFLICT (cell) DO NOTHING",
         cell);
  static_cast<void>(exists(database, kRow, cell));
}

Result<int> next_version(Database& database, const std::string& cell) {
  auto row = prepare(database,
                     "INSERT INTO cells (cell, last_version) VALUES ($1, 1) ON CONFLICT (cell) DO "
                     "UPDATE SET last_version = cells.last_version + 1 RETURNING last_version",
                     cell);
  const std::int64_t next = row.next() ? row.integer64(0) : 0;
  if (next > std::numeric_limits<int>::max())
    return refused("cell {} has no number left for a version", cell);
  return static_cast<int>(next);
}

void count_version(Database& database, const std::string& cell, int version) {
  change(database,
         "INSERT INTO cells (cell, last_version) VALUES ($1, $2) ON CONFLICT (cell) DO UPDATE SET "
         "last_version = excluded.last_version WHERE excluded.last_version > cells.last_version",
         cell, version);
}

}  // namespace trammel
