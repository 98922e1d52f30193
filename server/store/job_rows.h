#pragma once

#include <cstdint>
#include <set>
#include <string>
#include <vector>

#include "server/store/claim_rows.h"
#include "server/store/database/database.h"
#include "server/store/store.h"

/// Jobs as rows, for the transactions of batches, jobs and models.
namespace trammel {

/// Numbers as SQL lists them, `1, 2, 3`: they need not be bound.
[[nodiscard]] std::string list_of(const std::set<std::int64_t>& ids);

/// Empty for another kind of job.
[[nodiscard]] AskedTraining training_of(const StoredJob& job);
/// The kind in the table of jobs. Its CHECK dates from before health checks, so these are also
/// listed in health_checks.
[[nodiscard]] const char* stored_kind(JobKind kind);

/// Queues the job; its batches are not written yet.
[[nodiscard]] std::int64_t insert_job(Database& database, const StoredJob& job);
void insert_job_batches(Database& database, std::int64_t job, const std::string& cell,
                        const std::vector<std::string>& batch_ids);
/// In the order asked for.
[[nodiscard]] std::vector<std::string> batches_of_job(Database& database, std::int64_t job);
/// The result of an UPDATE that should have changed one unfinished job; kNotFound: it has not.
[[nodiscard]] Status changed_one(int changes, std::int64_t job);
/// kConflict.
[[nodiscard]] Failure discarded_failure(const std::string& cell, const std::string& id);
/// Empty if the job does not exist.
[[nodiscard]] std::string cell_of_job(Database& database, std::int64_t job);
/// kNotFound: there is none.
[[nodiscard]] Result<StoredJob> read_job(Database& database, std::int64_t id);
/// Marks an unfinished job failed, with the row of the audit trail; false: there is none.
bool fail_job(Database& database, std::int64_t id, const std::string& message,
              const JobOutcome& outcome, const ChangeId& by);
/// Marks an unfinished job of `cell` (empty: any) done; kNotFound: there is none.
[[nodiscard]] Status end_job(Database& database, const Worker& worker, std::int64_t id,
                             const std::string& cell, int model_version, const std::string& message,
                             const JobOutcome& outcome);

}  // namespace trammel
