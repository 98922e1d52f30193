#include "server/store/changes.h"

#include "server/base/unix_time.h"
#include "server/store/connection.h"

namespace trammel {
namespace {

constexpr std::int64_t kChangesKept = 100'000;

}  // namespace

Result<std::optional<ChangeOutcome>> find_change(SQLite::Database& database, const ChangeId& change_id) {
  auto row = prepare(database, "SELECT asked, version, job, made_at FROM changes WHERE id = ?", change_id.id);
  if (!row.executeStep()) return std::nullopt;
  if (const auto asked = row.getColumn(0).getString(); asked != change_id.asked) {
    return failure(ErrorCode::kConflict, "request {} was '{}' before, and is '{}' now", change_id.id, asked,
                   change_id.asked)
        .of("request")
        .with_text(change_id.id);
  }
  return ChangeOutcome{row.getColumn(1).getInt(), row.getColumn(2).getInt64(), row.getColumn(3).getInt64()};
}

Status check_expected_version(SQLite::Database& database, const std::string& cell, const ChangeId& change_id) {
  if (!change_id.expected_version) return {};
  auto row = prepare(database, "SELECT version FROM activations WHERE cell = ? ORDER BY number DESC LIMIT 1", cell);
  const int version = row.executeStep() ? row.getColumn(0).getInt() : 0;
  const int expected = *change_id.expected_version;
  if (version == expected) return {};
  return failure(ErrorCode::kConflict, "cell {}: version {} is in force, not {} as expected", cell, version, expected)
      .of("expected")
      .beyond(expected, version)
      .next("look again, and decide anew");
}

void record_change(SQLite::Database& database, const ChangeId& change_id, const ChangeOutcome& outcome) {
  change(database, "INSERT INTO changes (id, asked, version, job, made_at) VALUES (?, ?, ?, ?, ?)", change_id.id,
         change_id.asked, outcome.version, outcome.job, unix_now());
  change(database, "DELETE FROM changes WHERE number <= (SELECT MAX(number) FROM changes) - ?", kChangesKept);
}

Result<std::optional<ChangeOutcome>> Store::outcome_of(const ChangeId& change_id) const {
  if (change_id.id.empty()) return std::nullopt;
  return connection_->exclusively([&](SQLite::Database& database) { return find_change(database, change_id); });
}

}  // namespace trammel
