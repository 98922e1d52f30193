// The findings of diagnoses and checks.
#include <algorithm>
#include <limits>
#include <utility>

#include "server/store/connection.h"
#include "server/store/job_rows.h"
#include "server/store/pruned.h"
#include "server/store/store.h"

namespace trammel {
namespace {

constexpr std::int64_t kAll = std::numeric_limits<std::int64_t>::max();  // rows
constexpr int kPagesKept = 20;  // pages of diagnoses; findings are kept for ever

}  // namespace

Result<StoredDiagnosis> Store::diagnosis(std::int64_t job) const {
  return connection_->exclusively([&](Database& database) -> Result<StoredDiagnosis> {
    auto row = prepare(database, "SELECT csv, findings, page FROM diagnoses WHERE job = $1", job);
    if (!row.next())
      return failure(ErrorCode::kNotFound, "job {} is no diagnosis", job).of("job").with_value(job);
    if (const auto asked = read_job(database, job);
        asked && is_pruned(database, "answer of job", asked->cell, std::to_string(job)))
      return pruned_failure(fmt::format("what job {} found", job)).of("job").with_value(job);
    return StoredDiagnosis{row.text(0), row.text(1), row.text(2)};
  });
}

Result<std::vector<StoredCheck>> Store::health_checks(const std::string& cell, std::int64_t since,
                                                      std::size_t most) const {
  return connection_->exclusively([&](Database& database) -> Result<std::vector<StoredCheck>> {
    auto rows =
        prepare(database,
                "SELECT jobs.id, finished_at, findings FROM health_checks JOIN jobs ON jobs.id = "
                "health_checks.job JOIN diagnoses ON diagnoses.job = jobs.id JOIN job_times ON "
                "job_times.job = jobs.id WHERE cell = $1 AND state = 'done' AND findings <> '' AND "
                "finished_at >= $2 ORDER BY jobs.id DESC LIMIT $3",
                cell, since, most == 0 ? kAll : static_cast<std::int64_t>(most));
    std::vector<StoredCheck> checks;
    while (rows.next()) {
      const std::int64_t job = rows.integer64(0);
      checks.push_back({job, rows.integer64(1), batches_of_job(database, job), rows.text(2)});
    }
    std::reverse(checks.begin(), checks.end());
    return checks;
  });
}

Status Store::store_findings(std::int64_t job, const std::string& findings,
                             const std::string& page) {
  return connection_->in_transaction([&](Database& database) -> Status {
    TRY(check_held(database, connection_->worker, job, true));
    const int changes =
        change(database, "UPDATE diagnoses SET findings = $1, page = $2 WHERE job = $3", findings,
               page, job);
    change(database,
           "UPDATE diagnoses SET page = '' WHERE page <> '' AND job NOT IN (SELECT job FROM "
           "diagnoses WHERE page <> '' ORDER BY job DESC LIMIT $1)",
           kPagesKept);
    return changed_one(changes, job);
  });
}

}  // namespace trammel
