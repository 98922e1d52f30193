#include "server/store/changes.h"

#include <algorithm>

#include "server/base/unix_time.h"
#include "server/store/connection.h"

namespace trammel {
namespace {

constexpr std::int64_t kChangesKept = 100'000;

/// Who put the model in force, and when, as a clause; empty: not recorded.
std::string who_decided(Database& database, const std::string& cell) {
  auto row = prepare(database,
                     "SELECT who, at FROM audit WHERE cell = $1 AND subject = 'in force' ORDER BY "
                     "number DESC LIMIT 1",
                     cell);
  if (!row.next()) return "";
  return fmt::format("; {} put it in force {} s ago", row.text(0),
                     std::max<std::int64_t>(unix_now() - row.integer64(1), 0));
}

}  // namespace

Result<std::optional<ChangeOutcome>> find_change(Database& database, const ChangeId& change_id) {
  // A locked row is durable. A row that is only read may be lost with the host that wrote it.
  const std::string sql =
      locked(database, "SELECT asked, version, job, made_at FROM changes WHERE id = $1");
  auto row = prepare(database, sql.c_str(), change_id.id);
  if (!row.next()) return std::nullopt;
  if (const auto asked = row.text(0); asked != change_id.asked) {
    return failure(ErrorCode::kConflict, "request {} was '{}' before, and is '{}' now",
                   change_id.id, asked, change_id.asked)
        .of("request")
        .with_text(change_id.id);
  }
  return ChangeOutcome{row.integer(1), row.integer64(2), row.integer64(3)};
}

Status check_expected_version(Database& database, const std::string& cell,
                              const ChangeId& change_id) {
  if (!change_id.expected_version) return {};
  auto row =
      prepare(database,
              "SELECT version FROM activations WHERE cell = $1 ORDER BY number DESC LIMIT 1", cell);
  const int version = row.next() ? row.integer(0) : 0;
  const int expected = *change_id.expected_version;
  if (version == expected) return {};
  return failure(ErrorCode::kConflict, "cell {}: version {} is in force, not {} as expected{}",
                 cell, version, expected, who_decided(database, cell))
      .of("expected")
      .beyond(expected, version)
      .next("look again, and decide anew");
}

Status Store::check_expected(const std::string& cell, const ChangeId& change_id) const {
  return connection_->exclusively(
      [&](Database& database) { return check_expected_version(database, cell, change_id); });
}

void record_change(Database& database, const ChangeId& change_id, const ChangeOutcome& outcome) {
  change(database,
         "INSERT INTO changes (id, asked, version, job, made_at) VALUES ($1, $2, $3, $4, $5)",
         change_id.id, change_id.asked, outcome.version, outcome.job, unix_now());
  change(database, "DELETE FROM changes WHERE number <= (SELECT MAX(number) FROM changes) - $1",
         kChangesKept);
}

Result<std::optional<ChangeOutcome>> Store::outcome_of(const ChangeId& change_id) const {
  if (change_id.id.empty()) return std::nullopt;
  const auto find = [&](Database& database) { return find_change(database, change_id); };
  return connection_->is_shared() ? connection_->in_transaction(find)
                                  : connection_->exclusively(find);
}

}  // namespace trammel
