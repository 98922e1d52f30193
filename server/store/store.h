#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/base/result.h"
#include "server/compensate/compensated_model.h"

/// What must last: batches, jobs, models and their history, in one SQLite file (WAL, synchronous=FULL).
namespace trammel {

struct StoredBatch {
  std::string cell;
  std::string id;          ///< unique within the cell, for ever
  std::string csv;         ///< as it came
  std::string hash;        ///< SHA-256 of csv
  std::string request_id;  ///< client and sequence number of the request that brought it: a repeat of it is not a conflict
  std::int64_t accepted_at = 0;  ///< Unix time, s
  int poses = 0;
};

enum class JobState { kQueued, kRunning, kDone, kFailed };

/// One training to do or done.
struct StoredJob {
  std::int64_t id = 0;
  std::string cell;
  std::vector<std::string> batch_ids;  ///< trained together, in this order
  std::string level, bias;             ///< empty: as the cell file says
  JobState state = JobState::kQueued;
  std::string message;                 ///< why it failed, or what it made: `version 3, in force`
  std::int64_t created_at = 0;
  int model_version = 0;               ///< 0 until done
};

/// A line of a cell's model history.
struct StoredModel {
  std::string cell;
  int version = 0;  ///< 1, 2, 3... within the cell
  std::string id, hash, level, batch_id;
  std::int64_t created_at = 0;
  int training_poses = 0;
  double validation_rms = 0;  ///< m; 0 when nothing was held out
  bool in_force = false;
};

/// Thread-safe: one connection behind one lock. Every function that changes something is one transaction, on disk when
/// it returns.
class Store {
 public:
  /// Creates the file where there is none. Refuses a file of another program or of a newer schema, and a second writer
  /// process on the same file.
  [[nodiscard]] static Result<std::unique_ptr<Store>> open(const std::string& path);
  ~Store();

  /// Accepts the batch and queues its training job in one transaction; returns the job. The same request again returns
  /// the job it made then. Refuses (kConflict) an id that this cell already has.
  [[nodiscard]] Result<StoredJob> add_batch(const StoredBatch& batch, const StoredJob& job);
  /// Queues a job over batches that are already there. Refuses (kNotFound) unknown ones.
  [[nodiscard]] Result<StoredJob> add_job(const StoredJob& job);
  [[nodiscard]] Result<StoredBatch> batch(const std::string& cell, const std::string& id) const;
  /// Newest last, without their text.
  [[nodiscard]] Result<std::vector<StoredBatch>> batches(const std::string& cell) const;

  [[nodiscard]] Result<StoredJob> job(std::int64_t id) const;
  /// Queued and running ones of all cells, oldest first: what a restart must finish.
  [[nodiscard]] Result<std::vector<StoredJob>> unfinished_jobs() const;
  [[nodiscard]] Status set_job_running(std::int64_t id);
  [[nodiscard]] Status set_job_failed(std::int64_t id, const std::string& message);

  /// Stores the model as the cell's next version, marks `job` (0 = none) done and, if asked, puts it in force: one
  /// transaction. Returns the version.
  [[nodiscard]] Result<int> add_model(const std::string& cell, const CompensatedModel& model, std::int64_t job,
                                      bool put_in_force, const std::string& message);
  /// Puts a stored version in force. Refuses (kNotFound) an unknown one.
  [[nodiscard]] Status activate(const std::string& cell, int version);
  /// The version that was in force before the present one; kNotFound when there is none.
  [[nodiscard]] Result<int> previous_in_force(const std::string& cell) const;
  [[nodiscard]] Result<std::vector<StoredModel>> models(const std::string& cell) const;
  [[nodiscard]] Result<CompensatedModel> model(const std::string& cell, int version) const;
  /// Version in force; empty when none is.
  [[nodiscard]] Result<std::optional<int>> version_in_force(const std::string& cell) const;

 private:
  struct Connection;
  explicit Store(std::unique_ptr<Connection> connection);
  std::unique_ptr<Connection> connection_;
};

}  // namespace trammel
