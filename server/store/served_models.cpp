#include "server/store/served_models.h"

#include <filesystem>
#include <optional>
#include <system_error>
#include <utility>

#include "server/store/file_header.h"
#include "server/store/open_database.h"
#include "server/store/statements.h"

namespace trammel {
namespace {

constexpr int kMostLookedAt = 100;  // versions of a cell, as at a start

/// Opens the file to be read and runs `work(database)` on one moment of it.
template <typename Work>
auto reading(const std::string& path, const Work& work) -> decltype(work(std::declval<SQLite::Database&>())) {
  try {
    SQLite::Database database(uri_to_look_at(path), SQLite::OPEN_READONLY | SQLite::OPEN_URI, kBusyTimeout);
    const SQLite::Transaction moment(database);
    return work(database);
  } catch (const SQLite::Exception& error) {
    return failure(ErrorCode::kInternal, "cannot be read: {}", error.what()).in(path);
  }
}

}  // namespace

Result<ServedModels> ServedModels::open(const std::string& path) {
  std::error_code error;
  if (!std::filesystem::exists(path, error) || std::filesystem::file_size(path, error) == 0) return ServedModels("");
  return reading(path, [&](SQLite::Database& database) -> Result<ServedModels> {
    if (database.execAndGet("PRAGMA application_id").getInt() != kApplicationId) return refused("no store").in(path);
    return ServedModels(path);
  });
}

Result<bool> ServedModels::has(const std::string& cell) const {
  if (path_.empty()) return false;
  return reading(path_, [&](SQLite::Database& database) -> Result<bool> {
    return prepare(database, "SELECT 1 FROM activations WHERE cell = ?", cell).executeStep();
  });
}

Result<bool> ServedModels::find(const std::string& cell, const ModelVisitor& serves) const {
  if (path_.empty()) return false;
  return reading(path_, [&](SQLite::Database& database) -> Result<bool> {
    auto at =
        prepare(database,
                "WITH RECURSIVE chain (number, version, back, step) AS ("
                "SELECT * FROM (SELECT number, version, back, 0 FROM activations WHERE cell = ?1 "
                "ORDER BY number DESC LIMIT 1) UNION ALL "
                "SELECT a.number, a.version, a.back, step + 1 FROM chain JOIN activations a ON a.number = chain.back "
                "WHERE step + 1 < ?2) "
                "SELECT models.version, models.content FROM chain JOIN models "
                "ON models.cell = ?1 AND models.version = chain.version ORDER BY step",
                cell, kMostLookedAt);
    while (at.executeStep()) {
      if (serves(at.getColumn(0).getInt(), at.getColumn(1).getString())) return true;
    }
    return false;
  });
}

}  // namespace trammel
