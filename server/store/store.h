#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "server/base/result.h"
#include "server/compensate/compensated_model.h"

/// What must last: batches, jobs, models and their history, in one SQLite file (WAL, synchronous=FULL).
namespace trammel {

struct StoredBatch {
  std::string cell;
  std::string id;    ///< unique within the cell, for ever
  std::string csv;   ///< as it came
  std::string hash;  ///< SHA-256 of csv
  std::string
      request_id;  ///< client and sequence number of the request that brought it: a repeat of it is not a conflict
  std::int64_t accepted_at = 0;  ///< Unix time, s
  int poses = 0;
  std::int64_t job = 0;         ///< the one that it came with
  std::string quarantine = {};  ///< why no training takes it until it is released; empty: it is taken
};

enum class JobState { kQueued, kRunning, kDone, kFailed };

enum class JobKind { kTrain, kDiagnose };

/// One training or diagnosis to do or done.
struct StoredJob {
  std::int64_t id = 0;
  std::string cell;
  std::vector<std::string> batch_ids;  ///< trained together, in this order; none: a diagnosis brings its batch
  std::string level, bias;             ///< empty: as the cell file says
  JobState state = JobState::kQueued;
  std::string message;          ///< why it failed, or what became of its model
  std::int64_t created_at = 0;  ///< Unix time, s
  int model_version = 0;        ///< 0 until done
  int attempts = 0;             ///< times it was begun without being finished or put back
  JobKind kind = JobKind::kTrain;
  std::optional<std::int64_t> started_at = {};   ///< Unix time, s, of its last beginning; empty: not yet, not recorded
  std::optional<std::int64_t> finished_at = {};  ///< likewise of its end
};

/// What a diagnosis was asked and what it found.
struct StoredDiagnosis {
  std::string csv;        ///< the batch, where it was sent with the question; else empty
  bool apply = false;     ///< train what is found into the model
  std::string findings;   ///< JSON; empty until found
  std::string page = {};  ///< HTML; of the last few diagnoses only
};

/// A line of a cell's model history.
struct StoredModel {
  std::string cell;
  int version = 0;  ///< 1, 2, 3... within the cell
  std::string id, hash, level, batch_id;
  std::int64_t created_at = 0;  ///< Unix time of its being stored, s
  int training_poses = 0;
  double validation_rms = 0;  ///< m; 0 when nothing was held out
  bool in_force = false;
  std::int64_t trained_at = 0;                   ///< Unix time, s; where nobody recorded it, that of its being stored
  std::optional<std::int64_t> measured_at = {};  ///< see ModelProvenance
};

struct StoreConnection;

/// Thread-safe: one connection behind one lock. Every function that changes something is one transaction, on disk when
/// it returns. What the disk or the database refuses is kInternal and names the file.
class Store {
 public:
  /// Creates the file where there is none. Refuses (kRefused) a file of another program or of a newer schema,
  /// (kConflict) a second writer on the same file, (kInternal) a damaged file. Beside the file stands `<file>.lock`
  /// with the writer's process id.
  [[nodiscard]] static Result<std::unique_ptr<Store>> open(const std::string& path);
  ~Store();

  /// Accepts the batch and queues its training job (over this batch alone) in one transaction; returns the job. The
  /// same request with the same content again returns the job it made then. Refuses (kConflict) an id that this cell
  /// already has otherwise.
  [[nodiscard]] Result<StoredJob> add_batch(const StoredBatch& batch, const StoredJob& job);
  /// Queues a job over batches that are already there. Refuses (kNotFound) unknown ones. With `release` it may train
  /// from them in quarantine too: they leave it when its model is put in force, in the same transaction.
  [[nodiscard]] Result<StoredJob> add_job(const StoredJob& job, bool release = false);
  /// Whether the job was added so.
  [[nodiscard]] Result<bool> may_release(std::int64_t job) const;
  /// Queues a diagnosis: of the one batch that the job names, or of the one that comes with it. Refuses as add_job().
  [[nodiscard]] Result<StoredJob> add_diagnosis(const StoredJob& job, const StoredDiagnosis& diagnosis);
  /// kNotFound: the job is not there, or is no diagnosis.
  [[nodiscard]] Result<StoredDiagnosis> diagnosis(std::int64_t job) const;
  /// What an unfinished diagnosis has found; the job goes on.
  [[nodiscard]] Status store_findings(std::int64_t job, const std::string& findings, const std::string& page);
  [[nodiscard]] Result<StoredBatch> batch(const std::string& cell, const std::string& id) const;
  /// The same without its text: cheap.
  [[nodiscard]] Result<StoredBatch> batch_record(const std::string& cell, const std::string& id) const;
  /// The ids of those that a model of the cell was made from.
  [[nodiscard]] Result<std::set<std::string>> batches_learned_from(const std::string& cell) const;
  /// Keeps the batch out of trainings for `reason`, or lets it in again (empty).
  [[nodiscard]] Status set_quarantine(const std::string& cell, const std::string& id, const std::string& reason);
  /// Newest last, without their text.
  [[nodiscard]] Result<std::vector<StoredBatch>> batches(const std::string& cell) const;

  [[nodiscard]] Result<StoredJob> job(std::int64_t id) const;
  /// Queued and running ones of all cells, oldest first: what a restart must finish.
  [[nodiscard]] Result<std::vector<StoredJob>> unfinished_jobs() const;
  /// Of one cell or (empty) of all, oldest first: the unfinished ones, the last `finished` done and as many failed.
  [[nodiscard]] Result<std::vector<StoredJob>> recent_jobs(const std::string& cell, int finished) const;
  /// These refuse (kNotFound) a job that is done or failed already. Running counts an attempt; queued takes it back.
  [[nodiscard]] Status set_job_running(std::int64_t id);
  [[nodiscard]] Status set_job_queued(std::int64_t id);
  [[nodiscard]] Status set_job_failed(std::int64_t id, const std::string& message);
  /// Of a job that makes no model.
  [[nodiscard]] Status set_job_done(std::int64_t id, const std::string& message);

  /// Stores the model as the cell's next version, marks `job` (0 = none) done with `message` and, if asked, puts the
  /// model in force: one transaction. What the job may release leaves quarantine in it where the model goes in force or
  /// `release` says so. Returns the version.
  [[nodiscard]] Result<int> add_model(const std::string& cell, const CompensatedModel& model, std::int64_t job,
                                      bool put_in_force, const std::string& message, bool release = false);
  /// Puts a stored version in force; nothing changes when it is already. Refuses (kNotFound) an unknown one.
  ///
  /// The rule of going back: an activation remembers the one that it replaced. Rolling back restores that one together
  /// with what it remembers, so rolling back again goes further back and never forth: after 1, 2, 3 it gives 2, then 1,
  /// then kNotFound. Activating anew remembers what was in force at that moment, however that came to be.
  [[nodiscard]] Status activate(const std::string& cell, int version);
  /// The versions that rolling back again and again restores, the next one first; kNotFound when there is none.
  [[nodiscard]] Result<std::vector<int>> previous_in_force(const std::string& cell) const;
  /// Puts one of previous_in_force() in force, as `steps` rollbacks do; returns it.
  [[nodiscard]] Result<int> rollback(const std::string& cell, int steps = 1);
  /// Oldest first, without their content.
  [[nodiscard]] Result<std::vector<StoredModel>> models(const std::string& cell) const;
  [[nodiscard]] Result<CompensatedModel> model(const std::string& cell, int version) const;
  /// Version in force; empty when none is.
  [[nodiscard]] Result<std::optional<int>> version_in_force(const std::string& cell) const;

 private:
  explicit Store(std::unique_ptr<StoreConnection> connection);
  std::unique_ptr<StoreConnection> connection_;
};

}  // namespace trammel
