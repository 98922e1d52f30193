#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <stop_token>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "server/base/result.h"
#include "server/compensate/compensated_model.h"
#include "server/store/audit.h"
#include "server/store/change_id.h"
#include "server/store/job_outcome.h"
#include "server/store/served_models.h"
#include "server/store/servers.h"
#include "server/store/store_state.h"

/// Everything that survives a restart: batches, jobs, models and their history, in one SQLite file
/// (WAL, synchronous=FULL), or in one PostgreSQL database that several servers share.
namespace trammel {

struct StoredBatch {
  std::string cell;
  std::string id;          ///< unique within the cell, for ever
  std::string csv;         ///< the received text
  std::string hash;        ///< SHA-256 of csv
  std::string request_id;  ///< client and sequence number of the request that brought it; a repeat
                           ///< of that request is not a conflict
  std::int64_t accepted_at = 0;  ///< Unix time, s
  int poses = 0;
  std::int64_t job = 0;         ///< the job queued with it
  std::string quarantine = {};  ///< the reason for its quarantine; empty: not in quarantine
  std::string who = {};         ///< the sender of a new one, for the audit trail
  bool pruned = false;          ///< its text is gone
  bool discarded = false;       ///< it stays in quarantine for ever
  bool learned = false;         ///< it is among Store::batches_learned_from()
  std::string outcome =
      {};  ///< the outcome of the training queued with it; empty: it is not finished
};

enum class JobState { kQueued, kRunning, kDone, kFailed };

enum class JobKind { kTrain, kDiagnose, kCheck };

/// A model of batches.
struct AskedTraining {
  std::string level = {}, bias = {};  ///< empty: as the cell file says
};
/// A request to find the errors of a batch that the model in force does not explain.
struct AskedDiagnosis {
  bool apply = false;  ///< train a model with the causes found
};
/// A request to check whether the robot is still as the model in force has it.
struct AskedCheck {
  std::optional<double> tolerance = {};  ///< m; empty: as the cell file says
};
/// In the order of JobKind.
using AskedJob = std::variant<AskedTraining, AskedDiagnosis, AskedCheck>;
[[nodiscard]] inline JobKind kind_of(const AskedJob& asked) {
  return static_cast<JobKind>(asked.index());
}
/// True if the job makes a model: a training, or a diagnosis that is applied.
[[nodiscard]] inline bool is_to_train(const AskedJob& asked) {
  const auto* diagnosis = std::get_if<AskedDiagnosis>(&asked);
  return kind_of(asked) == JobKind::kTrain || (diagnosis != nullptr && diagnosis->apply);
}

/// A training, a diagnosis or a check, finished or not.
struct StoredJob {
  std::int64_t id = 0;
  std::string cell;
  std::vector<std::string>
      batch_ids;  ///< trained together, in this order; empty: a diagnosis of a batch sent with it
  AskedJob asked = {};
  JobState state = JobState::kQueued;
  std::string message;          ///< why it failed, or the outcome for its model
  std::int64_t created_at = 0;  ///< Unix time, s
  int model_version = 0;        ///< 0 until done
  int attempts = 0;  ///< the number of starts; putting it back in the queue subtracts one
  std::optional<std::int64_t> started_at =
      {};  ///< Unix time, s, of its last start; empty: not yet, or not recorded
  std::optional<std::int64_t> finished_at = {};  ///< likewise, of its end
  JobOutcome outcome = {};                       ///< the same as `message`, as data
  std::string server = {};  ///< the server that works on it, or did; empty: none, or not recorded

  [[nodiscard]] JobKind kind() const { return kind_of(asked); }
};

[[nodiscard]] inline bool is_over(const StoredJob& job) {
  return job.state == JobState::kDone || job.state == JobState::kFailed;
}

/// The job that came with a batch.
struct AcceptedJob : StoredJob {
  bool is_repeat = false;  ///< the batch existed already, and its job with it
};

/// The state of the claim on a job that runs here.
struct ClaimState {
  bool is_held = false;  ///< false: the lease was over, and another server has taken the job
  std::optional<std::string> cancelled_by =
      {};  ///< the person who asked another server to end it; empty: nobody
};

/// Counters of a record: an equal counter means an unchanged state.
struct RecordCounts {
  std::int64_t changes = 0;       ///< see changes_made()
  std::int64_t descriptions = 0;  ///< see descriptions_made()
};

/// The outcome of a wish that a job ends.
enum class CancelledJob {
  kEnded,  ///< it waited, or its server is gone: it has ended
  kAsked   ///< the server that works on it is notified
};

/// The texts that a diagnosis or a check has beside its job.
struct StoredDiagnosis {
  std::string csv;        ///< the batch if it was sent with the request; else empty
  std::string findings;   ///< JSON; empty until found
  std::string page = {};  ///< HTML; of the last few diagnoses only
};

/// A model to be stored.
struct NewModel {
  NewModel(const CompensatedModel& made, std::string serialized = {})
      : model(made), text(std::move(serialized)) {}
  const CompensatedModel& model;
  std::string text;  ///< the output of serialize(); empty: not serialized yet
};

/// A line of a cell's model history.
struct StoredModel {
  std::string cell;
  int version = 0;  ///< 1, 2, 3... within the cell
  std::string id, hash, level, batch_id;
  std::int64_t created_at = 0;  ///< Unix time, s, when it was stored
  int training_poses = 0;
  double validation_rms = 0;  ///< m; 0 when nothing was held out
  bool in_force = false;
  std::int64_t trained_at = 0;                   ///< Unix time, s; if not recorded, created_at
  std::optional<std::int64_t> measured_at = {};  ///< see ModelProvenance
};

/// A check of a robot's health that is over.
struct StoredCheck {
  std::int64_t job = 0;
  std::int64_t at = 0;                 ///< Unix time, s, of its end
  std::vector<std::string> batch_ids;  ///< empty: the batch came with it
  std::string findings;                ///< JSON
};

/// The version in force of a cell, and the verdict on it against its predecessor.
struct InForceRecord {
  int version = 0;
  std::int64_t since = 0;          ///< Unix time, s
  std::optional<int> before = {};  ///< the target of a rollback; empty: none
  std::optional<JobOutcome> judged =
      {};  ///< the time when it was put in force, else when it was made; empty: never
  bool judged_when_made = false;
};

/// The amount that is kept for each cell; 0: everything. The oldest unneeded data are removed.
/// Needed are the version in force, the targets of rollbacks, their training batches, and the
/// inputs of unfinished jobs.
struct KeepRule {
  int models = 0;   ///< versions besides those
  int batches = 0;  ///< likewise
  int answers = 0;  ///< findings of diagnoses that are over
};

class StoreConnection;

/// Thread-safe: a file is one connection behind one lock. Every function that changes data is one
/// transaction, which is on disk when the function returns. Errors of the disk or the database name
/// the file: kBusy if the disk does not allow writing now (full, read-only, broken) but may later,
/// kInternal if the file is damaged. A damaged row is an error only of functions that read it.
///
/// The last three versions in force of each cell are also kept as plain files beside the store
/// (`<file>.models`), which are used if the store cannot provide them.
class Store {
 public:
  /// Opens the store, and creates the file if there is neither a file nor copies of models served
  /// from it. Refuses (kConflict) a second writer on the same file, by any of its names. A file on
  /// a disk that cannot be written is opened for reading, and written as soon as possible: state().
  /// If the file is damaged, emptied, missing or another store's, the copies are served and nothing
  /// is written to it. Without copies it is refused (kInternal). A file of another program or with
  /// a newer schema is refused (kRefused). The file `<file>.lock` beside it holds the writer's
  /// process id. A URL of PostgreSQL is a store that several servers share; `cache` is the folder
  /// of its copies (empty: no copies). A database that is away is opened as well, and state() says
  /// so. Refuses (kRefused) an empty database, one of another program or with a newer schema, and a
  /// role without access.
  [[nodiscard]] static Result<std::unique_ptr<Store>> open(const std::string& place,
                                                           const std::string& cache = "");
  ~Store();

  /// Never waits for the disk.
  [[nodiscard]] StoreState state() const;
  [[nodiscard]] RecordState record() const;
  /// The mark that identifies the record of several servers; empty: it is a file, or not known yet.
  /// Does not wait.
  [[nodiscard]] std::string shared_identity() const;
  /// As in works_as().
  [[nodiscard]] const std::string& server() const;
  /// If the store could not be written or has changed, tests whether it can be written now. Reopens
  /// the file if needed, at most once a second.
  [[nodiscard]] Status try_again();
  /// False: `stop` was requested first.
  [[nodiscard]] bool wait_until_writable(const std::stop_token& stop);

  /// The trail of all changes, verified as a whole. Every function that changes more than the state
  /// of a running job writes it in its own transaction.
  [[nodiscard]] Result<AuditTrail> audit(const AuditQuery& query = {}) const;

  /// Accepts the batch and queues its training job (over this batch alone) in one transaction;
  /// returns the job. The same content under the same id, from any client, returns the first job.
  /// Refuses (kConflict) an id that the cell already has with other content.
  [[nodiscard]] Result<AcceptedJob> add_batch(const StoredBatch& batch, const StoredJob& job);
  /// The outcome of a change; empty: it has not been made. Refuses (kConflict) an id that was used
  /// for another change. The functions that take a ChangeId record it in the transaction of the
  /// change itself. If the id is already recorded, they change nothing and return the earlier
  /// outcome. The last 100,000 are kept.
  [[nodiscard]] Result<std::optional<ChangeOutcome>> outcome_of(const ChangeId& change_id) const;
  /// Queues a job over existing batches. Refuses (kNotFound) unknown ones, (kConflict) discarded
  /// ones. With `release` it may also train from batches in quarantine. They leave quarantine in
  /// the transaction that puts its model in force.
  [[nodiscard]] Result<StoredJob> add_job(const StoredJob& job, bool release = false,
                                          const ChangeId& change_id = {});
  /// True if a job made that version here; false: it was imported.
  [[nodiscard]] Result<bool> was_made_by_job(const std::string& cell, int version) const;
  /// The batches of the job that made that version here, without the earlier batches in its
  /// training.
  [[nodiscard]] Result<std::set<std::string>> batches_of_version(const std::string& cell,
                                                                 int version) const;
  /// True if the job was added with `release`.
  [[nodiscard]] Result<bool> may_release(std::int64_t job) const;
  /// Queues a diagnosis or a check of the one batch that `job` names, or of `csv`. Refuses as
  /// add_job().
  [[nodiscard]] Result<StoredJob> add_diagnosis(const StoredJob& job, const std::string& csv,
                                                const ChangeId& change_id = {});
  /// kNotFound: the job does not exist, is not a diagnosis, or its findings were pruned.
  [[nodiscard]] Result<StoredDiagnosis> diagnosis(std::int64_t job) const;
  /// The checks of the cell, oldest first: those that ended since then (Unix time, s), at most the
  /// newest `most` (0: all).
  [[nodiscard]] Result<std::vector<StoredCheck>> health_checks(const std::string& cell,
                                                               std::int64_t since,
                                                               std::size_t most) const;
  /// Stores the findings of an unfinished diagnosis. The job goes on.
  [[nodiscard]] Status store_findings(std::int64_t job, const std::string& findings,
                                      const std::string& page);
  /// kNotFound also where its text was pruned.
  [[nodiscard]] Result<StoredBatch> batch(const std::string& cell, const std::string& id) const;
  /// The batch without its text: cheap.
  [[nodiscard]] Result<StoredBatch> batch_record(const std::string& cell,
                                                 const std::string& id) const;
  /// The number of changes in the audit trail. While it is equal, so is the state that the trail
  /// describes.
  [[nodiscard]] Result<std::int64_t> changes_made() const;
  /// changes_made() with descriptions_made(), by one statement; for a store that several servers
  /// share.
  [[nodiscard]] Result<RecordCounts> counts() const;
  /// The ids of the batches that later trainings of the cell may learn from. Either a model from
  /// the batch was in force at some time, or its outcome has no is_doubt().
  [[nodiscard]] Result<std::set<std::string>> batches_learned_from(const std::string& cell) const;
  /// Puts the batch in quarantine for `reason`, or releases it (empty). Refuses (kConflict) a
  /// discarded one. `by_job`: also refuses (kNotFound) if another server has that job by now.
  [[nodiscard]] Status set_quarantine(const std::string& cell, const std::string& id,
                                      const std::string& reason, const ChangeId& change_id = {},
                                      std::int64_t by_job = 0);
  /// Puts the batch in quarantine for ever: nothing uses it any more. Its text stays until it is
  /// pruned.
  [[nodiscard]] Status discard(const std::string& cell, const std::string& id,
                               const ChangeId& change_id = {});
  /// Newest last, without their text.
  [[nodiscard]] Result<std::vector<StoredBatch>> batches(const std::string& cell) const;

  /// Removes the text of one model, batch or answer that `rule` does not keep; its record stays.
  /// False: there is none left. Call it repeatedly; others use the store in between.
  [[nodiscard]] Result<bool> prune_one(const std::string& cell, const KeepRule& rule);

  /// Several servers share it.
  [[nodiscard]] bool is_shared() const;
  /// Sets the name under which this server claims a job. To be set before there are jobs.
  void works_as(const std::string& server);
  /// Renews this server's claim on a job. It waits for no disk and no standby, since losing the
  /// renewal with a host only ends the lease earlier.
  [[nodiscard]] Result<ClaimState> renew_claim(std::int64_t job);
  /// Ends a waiting job, and asks the server that works on a running one to end it. Refuses
  /// (kConflict) a finished one.
  [[nodiscard]] Result<CancelledJob> cancel_job(std::int64_t job, const JobOutcome& outcome,
                                                const ChangeId& by);
  /// A heartbeat: tells the other servers that this one is present, and its work. Does nothing for
  /// a store with one server. It waits for no disk and no standby, as renew_claim(). For one thread
  /// at a time.
  [[nodiscard]] Status tell_presence(const ServerSelf& self);
  /// It ends: the others need not wait for its heartbeat.
  [[nodiscard]] Status take_leave();
  /// All present servers, and those that disappeared without notice during the last day, by name;
  /// `with_cells`: with the models that they serve. Empty for a store with one server.
  [[nodiscard]] Result<std::vector<ServerInRecord>> servers(bool with_cells) const;
  /// The number of descriptions of cells ever made. While it is equal, so are the descriptions.
  [[nodiscard]] Result<std::int64_t> descriptions_made() const;
  /// Compares this server's descriptions of cells with those of the record. A cell without a
  /// description gets this server's. Another description replaces it in two cases: more servers (at
  /// least two) want it than any other, counting servers that started with it and are kept apart
  /// for it; or no other server is present, and the present description came from this server's own
  /// earlier files, as it `starts`. Returns the cells whose files differ, with a sentence each: why
  /// the server does not answer for the cell, or, if its files were the record's when it began
  /// (`agreed`), why it changes nothing of the cell. Needs tell_presence() before.
  [[nodiscard]] Result<std::map<std::string, std::string>> agree_on_cells(
      const std::map<std::string, CellDescription>& mine, bool starts,
      const std::set<std::string>& agreed = {});
  /// Waiting jobs without a live worker, whose cell has no live worker on another job; with the
  /// cell of each. By one statement.
  [[nodiscard]] Result<std::map<std::int64_t, std::string>> jobs_to_take() const;
  /// The cells changed by the changes after that many; see changes_made().
  [[nodiscard]] Result<std::set<std::string>> cells_changed_after(std::int64_t changes) const;
  /// Returns when another server may have changed something, after `limit` at the latest, or when
  /// `stop` is requested. For one thread.
  void wait_for_change(const std::stop_token& stop, std::chrono::milliseconds limit);
  /// The service is to end: no call, and none under way, waits for the database of several servers
  /// for longer than a few seconds from now.
  void will_end();
  /// Refuses (kConflict) where another version of the cell is in force than the change expects.
  [[nodiscard]] Status check_expected(const std::string& cell, const ChangeId& change_id) const;

  [[nodiscard]] Result<StoredJob> job(std::int64_t id) const;
  /// The existing ones among these jobs, oldest first. By two statements, for any number.
  [[nodiscard]] Result<std::vector<StoredJob>> jobs(const std::set<std::int64_t>& ids) const;
  /// Those of these jobs that came with their batch. The others were requested separately.
  [[nodiscard]] Result<std::set<std::int64_t>> came_with_batches(
      const std::set<std::int64_t>& ids) const;
  /// Queued and running jobs of all cells, oldest first: a restart must finish them. Unreadable
  /// ones are left out, and reported in state().
  [[nodiscard]] Result<std::vector<StoredJob>> unfinished_jobs() const;
  /// Jobs of one cell or (empty) of all, oldest first: the unfinished ones, the last `finished`
  /// done and the last `finished` failed.
  [[nodiscard]] Result<std::vector<StoredJob>> recent_jobs(const std::string& cell,
                                                           int finished) const;
  /// These functions refuse (kNotFound) a job that is done or failed, or that another server works
  /// on. Setting it running claims it for this server and counts an attempt; it refuses (kConflict)
  /// a job of a cell on which another server works. Setting it queued takes the attempt back,
  /// unless it counts.
  [[nodiscard]] Status set_job_running(std::int64_t id);
  [[nodiscard]] Status set_job_queued(std::int64_t id, bool attempt_counts = false);
  [[nodiscard]] Status set_job_failed(std::int64_t id, const std::string& message,
                                      const JobOutcome& outcome = {}, const ChangeId& by = {});
  /// For a job that makes no model.
  [[nodiscard]] Status set_job_done(std::int64_t id, const std::string& message,
                                    const JobOutcome& outcome = {});

  /// Stores the model as the cell's next version, marks `job` (0 = none) done with `message` and
  /// `outcome` and, if asked, puts the model in force, all in one transaction. If the model is put
  /// in force, or if `release` is set, the batches that the job may release leave quarantine.
  /// Returns the version.
  [[nodiscard]] Result<int> add_model(const std::string& cell, const NewModel& model,
                                      std::int64_t job, bool put_in_force,
                                      const std::string& message, bool release = false,
                                      const ChangeId& change_id = {},
                                      const JobOutcome& outcome = {});
  /// Puts a stored version in force. Changes nothing if it is in force already. Refuses (kNotFound)
  /// an unknown one. `judged`: the comparison with the version in force until now, for
  /// in_force_record() and the audit trail.
  ///
  /// Rollback works as follows: an activation remembers the one that it replaced. A rollback
  /// restores that one with its own memory, so the next rollback goes further back: after 1, 2, 3
  /// it gives 2, then 1, then kNotFound. A new activation remembers the version that is in force at
  /// that moment, even if a rollback put it there.
  [[nodiscard]] Status activate(const std::string& cell, int version,
                                const ChangeId& change_id = {},
                                const std::optional<JobOutcome>& judged = {});
  /// Empty: nothing is in force.
  [[nodiscard]] Result<std::optional<InForceRecord>> in_force_record(const std::string& cell) const;
  /// The versions that repeated rollbacks restore, the next one first. kNotFound: there is none.
  [[nodiscard]] Result<std::vector<int>> previous_in_force(const std::string& cell) const;
  /// Puts one of previous_in_force() in force, as `steps` rollbacks do; returns it.
  [[nodiscard]] Result<int> rollback(const std::string& cell, int steps = 1,
                                     const ChangeId& change_id = {});
  /// Oldest first, without their content.
  [[nodiscard]] Result<std::vector<StoredModel>> models(const std::string& cell) const;
  /// Reads the model from the store or, if the store cannot provide it, from its copy.
  [[nodiscard]] Result<ReadModel> read(const std::string& cell, int version) const;
  [[nodiscard]] Result<CompensatedModel> model(const std::string& cell, int version) const;
  /// The stored text of the model, unchecked. kNotFound also if it was pruned.
  [[nodiscard]] Result<std::string> model_text(const std::string& cell, int version) const;
  /// Version in force; empty when none is.
  [[nodiscard]] Result<std::optional<int>> version_in_force(const std::string& cell) const;
  /// The version in force of every cell that has one. One statement reads all of them at one
  /// moment.
  [[nodiscard]] Result<std::map<std::string, int>> versions_in_force() const;
  /// The versions to serve the cell with, the best first: the one in force, then in the order of
  /// rollbacks, then those that only copies have. Versions newer than the store's come before the
  /// one in force. Never fails: it may be empty.
  [[nodiscard]] std::vector<int> versions_to_serve(const std::string& cell) const;
  /// If the store has lost the version last in force, and a copy exists, adds the copy to the
  /// history as the version in force.
  [[nodiscard]] Status take_back_from_copy(const std::string& cell);
  /// Copies the model in force, if it has no copy.
  [[nodiscard]] Status copy_model_in_force(const std::string& cell) const;

 private:
  explicit Store(std::unique_ptr<StoreConnection> connection);
  void copy_after_change(const std::string& cell) const;
  std::unique_ptr<StoreConnection> connection_;
};

}  // namespace trammel
