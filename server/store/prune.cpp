// Pruning removes texts, never rows: dates, hashes and figures stay, ids stay used, and the audit
// trail lists the removed texts. Each transaction removes one text, so that nobody waits for long.
#include <set>
#include <utility>

#include "server/store/audit_rows.h"
#include "server/store/cell_rows.h"
#include "server/store/connection.h"
#include "server/store/pruned.h"
#include "server/store/store.h"

namespace trammel {
namespace {

using Versions = std::set<int>;
using Ids = std::set<std::string>;

/// The version in force and the targets of rollbacks.
Versions versions_needed(Database& database, const std::string& cell) {
  auto rows =
      prepare(database,
              "WITH RECURSIVE way (number, version, back) AS (SELECT * FROM (SELECT number, "
              "version, back FROM activations WHERE cell = $1 ORDER BY number DESC LIMIT 1) AS "
              "present UNION SELECT a.number, a.version, a.back FROM activations a JOIN way ON "
              "a.number = way.back) SELECT DISTINCT version FROM way",
              cell);
  Versions needed;
  while (rows.next()) needed.insert(rows.integer(0));
  return needed;
}

/// `a+b+c`: each, and the whole, for an id may hold a plus sign.
void add_parts(const std::string& joined, Ids& ids) {
  ids.insert(joined);
  for (std::size_t begin = 0; begin <= joined.size();) {
    const std::size_t end = std::min(joined.find('+', begin), joined.size());
    ids.insert(joined.substr(begin, end - begin));
    begin = end + 1;
  }
}

/// The training batches of those versions, and the batches of unfinished jobs.
Ids batches_needed(Database& database, const std::string& cell) {
  const Versions versions = versions_needed(database, cell);
  Ids needed;
  auto models = prepare(database, "SELECT version, batch_id FROM models WHERE cell = $1", cell);
  while (models.next()) {
    if (versions.contains(models.integer(0))) add_parts(models.text(1), needed);
  }
  auto taken =
      prepare(database,
              "SELECT jobs.model_version, jobs.state IN ('queued', 'running'), job_batches.batch "
              "FROM job_batches JOIN jobs ON jobs.id = job_batches.job WHERE jobs.cell = $1",
              cell);
  while (taken.next()) {
    if (versions.contains(taken.integer(0)) || taken.truth(1)) needed.insert(taken.text(2));
  }
  return needed;
}

/// Something whose text may go.
struct Text {
  std::string id;
  std::string hash;
};

/// The oldest of `rows` (oldest first) that is not needed. Empty if at most `keep` are left; `keep`
/// 0 keeps all.
template <typename Needed>
std::optional<Text> oldest_beyond(Rows rows, int keep, const Needed& needed) {
  std::optional<Text> oldest;
  int count = 0;
  while (keep > 0 && rows.next()) {
    if (needed(rows)) continue;
    if (!oldest) oldest = Text{rows.text(0), rows.text(1)};
    ++count;
  }
  return count > keep ? oldest : std::nullopt;
}

void record(Database& database, const std::string& cell, const char* kind, const Text& text,
            const std::string& rule) {
  change(database, "INSERT INTO pruned (kind, cell, id) VALUES ($1, $2, $3)", kind, cell, text.id);
  record_audit(database, {cell, "prune", fmt::format("{} {}", kind, text.id),
                          text.hash.empty() ? "its text" : "its text, sha256 " + text.hash,
                          "its record alone", rule});
}

bool prune_model(Database& database, const std::string& cell, int keep) {
  const Versions needed = versions_needed(database, cell);
  const auto text = oldest_beyond(
      prepare(database,
              "SELECT version, hash FROM models WHERE cell = $1 AND CAST(version AS TEXT) NOT IN "
              "(SELECT id FROM pruned WHERE kind = 'version' AND cell = $1) ORDER BY version",
              cell),
      keep, [&](Rows& row) { return needed.contains(row.integer(0)); });
  if (!text) return false;
  change(database, "UPDATE models SET content = '' WHERE cell = $1 AND version = $2", cell,
         std::stoi(text->id));
  record(database, cell, "version", *text, fmt::format("keep_models {}", keep));
  return true;
}

bool prune_batch(Database& database, const std::string& cell, int keep) {
  const Ids needed = batches_needed(database, cell);
  const auto text =
      oldest_beyond(prepare(database,
                            "SELECT id, hash FROM batches WHERE cell = $1 AND id NOT IN (SELECT id "
                            "FROM pruned WHERE kind = 'batch' AND cell = $1) ORDER BY number",
                            cell),
                    keep, [&](Rows& row) { return needed.contains(row.text(0)); });
  if (!text) return false;
  change(database, "UPDATE batches SET csv = '' WHERE cell = $1 AND id = $2", cell, text->id);
  record(database, cell, "batch", *text, fmt::format("keep_batches {}", keep));
  return true;
}

bool prune_answer(Database& database, const std::string& cell, int keep) {
  const auto text = oldest_beyond(
      prepare(
          database,
          "SELECT jobs.id, '' FROM diagnoses JOIN jobs ON jobs.id = diagnoses.job WHERE jobs.cell "
          "= $1 AND jobs.state IN ('done', 'failed') AND CAST(jobs.id AS TEXT) NOT IN (SELECT id "
          "FROM pruned WHERE kind = 'answer of job' AND cell = $1) ORDER BY jobs.id",
          cell),
      keep, [](Rows&) { return false; });
  if (!text) return false;
  change(database, "UPDATE diagnoses SET csv = '', findings = '', page = '' WHERE job = $1",
         static_cast<std::int64_t>(std::stoll(text->id)));
  record(database, cell, "answer of job", *text, fmt::format("keep_answers {}", keep));
  return true;
}

}  // namespace

bool is_pruned(Database& database, const char* kind, const std::string& cell,
               const std::string& id) {
  return exists(database, "SELECT 1 FROM pruned WHERE kind = $1 AND cell = $2 AND id = $3", kind,
                cell, id);
}

Failure pruned_failure(const std::string& what) {
  return failure(ErrorCode::kNotFound, "{} was pruned: its record is there, its text is not", what);
}

Result<bool> Store::prune_one(const std::string& cell, const KeepRule& rule) {
  if (rule.models == 0 && rule.batches == 0 && rule.answers == 0) return false;
  return connection_->in_transaction([&](Database& database) -> Result<bool> {
    lock_cell(database, cell);
    return prune_model(database, cell, rule.models) || prune_batch(database, cell, rule.batches) ||
           prune_answer(database, cell, rule.answers);
  });
}

}  // namespace trammel
