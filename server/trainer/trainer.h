#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "server/base/mutex.h"
#include "server/registry/model_registry.h"
#include "server/store/store.h"
#include "server/trainer/cell_book.h"
#include "server/trainer/job_progress.h"
#include "server/trainer/job_queue.h"
#include "server/trainer/job_runner.h"
#include "server/trainer/model_history.h"
#include "server/trainer/presence.h"
#include "server/trainer/trainer_options.h"

namespace trammel {

/// The queue of trainings and diagnoses, and the one thread that works on it: JobRunner does one
/// job, ModelHistory keeps its models. Every accepted batch or job is in the store before it is
/// acknowledged. A job that a crash interrupts is taken up at the next start, at most three times.
/// Thread-safe, except take_up(), start() and stop().
///
/// The held-out rows are drawn batch by batch: a row that is held out once is held out in every
/// training of that batch. So the model in force and its successor are compared on poses of all
/// stored batches that neither was trained on (judge()). A batch that covers much less of the joint
/// ranges than the model in force, or fewer of its tools, updates base and tool only; the rest of
/// that model stays.
class Trainer {
 public:
  /// Called by whichever thread changes the job; for one job never by two at a time.
  using ProgressListener = ProgressBook::Listener;
  using ModelListener = ModelHistory::Listener;
  /// Something is wrong, or (`over`) no longer.
  using TroubleListener = std::function<void(const std::string& trouble, bool over)>;

  /// `store` and `registry` outlive it.
  Trainer(const ServedCells& cells, Store& store, ModelRegistry& registry, TrainerOptions options);
  ~Trainer();  ///< stops as stop()

  /// Set before start().
  void set_listeners(ProgressListener progress, ModelListener model,
                     TroubleListener trouble = nullptr);
  /// Announces the models in force of the store, loads as many as a second allows (the others at
  /// their first request, or in the background), and queues unfinished jobs. Returns problems for
  /// the log: a model that does not load or was trained for another robot or tool, a job of a cell
  /// that is not served here, a job that was interrupted too often and is now failed. Requests may
  /// come as soon as it returns.
  [[nodiscard]] Result<std::vector<std::string>> take_up();
  /// Reports the jobs taken up and starts the threads. Does take_up() itself where that has not
  /// been done.
  [[nodiscard]] Result<std::vector<std::string>> start();
  /// Asks the running training to give up (its job stays queued in the store) and joins.
  void stop();

  /// True if the server works on jobs.
  [[nodiscard]] bool trains() const { return options_.trains; }
  /// Stays as it is until the end; the next call may give more cells.
  [[nodiscard]] const ServedCells& cells() const { return cells_.now(); }
  /// Adds cells to the served ones, with their models in force and waiting jobs from the store.
  /// Returns problems for the log. Thread-safe.
  [[nodiscard]] std::vector<std::string> add_cells(const ServedCells& more);
  /// From now on TrainerOptions::queue_capacity and TrainerOptions::keep are these. Thread-safe.
  void set_limits(int queue_capacity, const KeepRule& keep);
  /// The troubles of now: with the store, with its disk, with the models of cells; one sentence
  /// each. Never waits.
  [[nodiscard]] std::vector<std::string> troubles() const;

  /// Checks the batch against its cell, stores it with its job, and queues the job. When its turn
  /// comes, the batch is tested against the model in force (triage()): a batch that must not be
  /// learned from goes into quarantine with the reason, and its job fails. Returns the job id; the
  /// same batch again, from any client, returns the same id. Refuses errors of the batch reader and
  /// the cell, an unknown cell (kNotFound), an id that the cell has with other content (kConflict)
  /// and too many poses (kTooLarge). A batch is accepted however many jobs wait.
  [[nodiscard]] Result<std::int64_t> submit(const std::string& cell, const std::string& batch_id,
                                            const std::string& csv, const std::string& request_id,
                                            const std::string& who = {});
  /// Selects whether batches of a requested training leave quarantine. Released ones leave when the
  /// model goes in force, automatically or by a person, or when there are too few poses to judge
  /// it. They stay if it is judged and found not better.
  enum class Quarantine { kStays, kReleased };
  /// Trains again from stored batches, together; none named = the newest one. Empty level and bias:
  /// the cell's, with the additions of the model in force. Refuses batches that stay in quarantine.
  /// Refuses (kBusy) when the cell has as many requested jobs waiting as it may. Refuses requests
  /// beyond the limits of a training: max_poses, 1000 batches, 500 error sources, a bias of 32
  /// kernels.
  [[nodiscard]] Result<std::int64_t> retrain(const std::string& cell,
                                             const std::vector<std::string>& batch_ids,
                                             const std::string& level, const std::string& bias,
                                             Quarantine quarantine = Quarantine::kStays,
                                             const ChangeId& id = {});
  /// Diagnoses a stored batch (`batch_id`; empty: the newest) or `csv`: finds the errors that the
  /// error sources of the model in force (or of the cell) do not explain. With `apply` it trains
  /// with the found causes added, and puts the model in force only if it is better beyond chance on
  /// the held-out rows. Returns the job; diagnosis() has its findings. Refuses the same as submit()
  /// and retrain(), but accepts a quarantined batch.
  [[nodiscard]] Result<std::int64_t> diagnose(const std::string& cell, const std::string& batch_id,
                                              const std::string& csv, bool apply,
                                              const ChangeId& id = {});
  /// Tests with a few poses whether the robot is still as the model in force has it
  /// (check_health()). `tolerance_mm`: empty means the cell file's. Returns the job; diagnosis()
  /// has its findings. Refuses the same as diagnose(), and a cell without a model in force
  /// (kNotFound).
  [[nodiscard]] Result<std::int64_t> check(const std::string& cell, const std::string& batch_id,
                                           const std::string& csv,
                                           std::optional<double> tolerance_mm,
                                           const ChangeId& id = {});
  /// The findings of a job after its diagnosis or check; kBusy before.
  [[nodiscard]] Result<StoredDiagnosis> diagnosis(std::int64_t job) const;
  /// Ends a job that waits or runs, here or on another server of the same store. Its outcome is
  /// kCancelled, and nothing of it is stored except findings that a diagnosis already had. The
  /// batch that came with it stays, and can be trained from on request. Returns when a waiting job
  /// is stored as ended; a running one ends within a second. Refuses an unknown job (kNotFound) and
  /// a finished one (kConflict).
  [[nodiscard]] Status cancel(std::int64_t job, const ChangeId& by = {});
  /// Lets trainings use a batch that was quarantined because it did not fit the model in force.
  [[nodiscard]] Status release(const std::string& cell, const std::string& batch_id,
                               const ChangeId& id = {});
  /// Nothing takes the batch any more.
  [[nodiscard]] Status discard(const std::string& cell, const std::string& batch_id,
                               const ChangeId& id = {});
  /// All batches, without their text, of one cell or (empty) of all, oldest first.
  [[nodiscard]] Result<std::vector<StoredBatch>> batches(const std::string& cell) const;
  /// The batches in quarantine.
  [[nodiscard]] Result<std::vector<StoredBatch>> quarantined(const std::string& cell) const;
  /// See ModelHistory. Report requested poses to it.
  [[nodiscard]] RecentPoses& recent_poses() { return history_.recent_poses(); }
  /// See ModelHistory. Any version is judged first, like a new one. If it is worse than the one in
  /// force on the same poses, it is refused with the figures, unless `force` is set. The same holds
  /// for an imported version that cannot be judged.
  [[nodiscard]] Status activate(const std::string& cell, int version, const ChangeId& id = {},
                                bool force = false);
  [[nodiscard]] Result<int> rollback(const std::string& cell, const ChangeId& id = {}) {
    return history_.rollback(cell, id);
  }
  [[nodiscard]] Result<int> import_model(const std::string& cell, const std::string& text,
                                         const ChangeId& id = {}) {
    return history_.import_model(cell, text, id);
  }
  [[nodiscard]] Result<CompensatedModel> load_for_service(const std::string& cell,
                                                          int version) const {
    return history_.load_for_service(cell, version);
  }

  /// The progress of an unfinished job as it goes on, of a finished one from the store.
  [[nodiscard]] Result<JobProgress> progress(std::int64_t job) const;
  /// A job with its request and its times.
  struct DatedJob {
    StoredJob asked;
    JobProgress progress;
  };
  /// The jobs of one cell or (empty) of all, oldest first: waiting and running ones, and the last
  /// ended ones.
  [[nodiscard]] Result<std::vector<DatedJob>> jobs(const std::string& cell) const;
  /// The waiting and running jobs with their progress, oldest first. From memory.
  [[nodiscard]] std::vector<JobProgress> unfinished_jobs() const { return book_.unfinished(); }
  /// The troubles with the models that cells are served with; see ModelHistory.
  [[nodiscard]] std::map<std::string, CellTrouble> cell_troubles() const;
  /// Why this server may not answer for the cell though it has its files; empty: it may.
  [[nodiscard]] std::optional<std::string> why_apart(const std::string& cell) const {
    return cells_.why_apart(cell);
  }
  /// This server's description of itself.
  [[nodiscard]] ServerSelf self() const;
  /// The servers of the record, this one included, as last heard of, without the models that they
  /// serve. From memory.
  [[nodiscard]] std::vector<ServerInRecord> servers_seen() const;
  /// The servers of the record with the models that they serve, as the record has them now.
  [[nodiscard]] Result<std::vector<ServerInRecord>> servers() const;
  /// Waiting, without the one being trained.
  [[nodiscard]] int queued_jobs() const;

 private:
  /// Checks the batch (its text, and when it was accepted first), stores it with its job, queues
  /// it.
  [[nodiscard]] Result<std::int64_t> take_in(StoredBatch batch);
  /// Loads models in the background, retries a store that cannot be written, and reports troubles
  /// other than those in `told`.
  void keep_up(std::vector<std::string> told, const std::stop_token& stop);
  /// Prunes data that the rule does not keep, in small changes.
  void prune(const std::string& cell, const std::stop_token& stop);
  /// Takes up a store that can be read only now.
  void take_up_late();
  /// With several servers on one store: takes up the others' changes, and keeps the claim on the
  /// running job.
  void follow(std::int64_t followed, const std::stop_token& stop);
  /// Takes up the versions put in force since change number `followed`, of `made` changes; returns
  /// the number of changes taken up.
  [[nodiscard]] std::int64_t follow_models(std::int64_t followed, std::int64_t made);
  /// Which jobs wait, run elsewhere or are over.
  void follow_jobs();
  /// Reports the outcome of a known job that another server has.
  void follow_job(const StoredJob& job);
  /// Compares the files of its cells with the record if either may have changed, and sets the
  /// differing cells apart. `descriptions`: the number of descriptions ever made.
  void agree(std::int64_t descriptions) TRAMMEL_EXCLUDES(agree_mutex_);
  /// Announces this server to the others, and keeps the claim on the running job. Waits for no
  /// other work.
  void beat(const std::stop_token& stop);
  /// This server by its own view, for a store that no other server has.
  [[nodiscard]] ServerInRecord alone() const;
  [[nodiscard]] Status cancel_in_record(const StoredJob& job, const ChangeId& by);
  /// Ends the computation of a job that this server has lost, or that was cancelled on another
  /// server.
  void keep_claim();
  /// Takes up jobs of served cells that do not wait here already.
  void take_up_jobs(std::vector<StoredJob> jobs, std::vector<std::string>& notices)
      TRAMMEL_REQUIRES(submit_mutex_);
  void tell_troubles(std::vector<std::string>& told);
  /// Refuses (kBusy) if as many requested jobs of this cell wait as may.
  [[nodiscard]] Status check_room(const std::string& cell) const;
  /// The progress of a job as the store has it.
  [[nodiscard]] JobProgress stored_progress(const StoredJob& job) const;
  /// The job that was queued under this id before; empty: none.
  [[nodiscard]] Result<std::optional<std::int64_t>> queued_before(const ChangeId& id) const;
  void enqueue(const StoredJob& job, bool asked_for);
  /// True if the job was requested; otherwise it came with its batch.
  [[nodiscard]] Result<bool> was_asked_for(const StoredJob& job) const;
  /// True if an unfinished job of the store is to be worked on; otherwise a notice gives the
  /// reason.
  [[nodiscard]] Result<bool> can_take_up(const StoredJob& job, std::vector<std::string>& notices);
  /// The verdict on a version against the one in force, on the cell's measurements; empty if there
  /// is nothing to compare with.
  [[nodiscard]] Result<std::optional<GateVerdict>> judged_beside_present(const std::string& cell,
                                                                         int version) const;
  /// Refuses a version that the verdict finds worse, or cannot judge.
  [[nodiscard]] Status check_not_worse(const std::string& cell, int version,
                                       const GateVerdict& verdict) const;
  /// Checks that the stored batches may be trained from together.
  [[nodiscard]] Status check_together(const std::vector<StoredBatch>& stored,
                                      const std::vector<std::string>& batch_ids,
                                      bool release) const;
  /// Queues a job that examines one batch and learns nothing from it, unless it is to `apply` its
  /// findings.
  [[nodiscard]] Result<std::int64_t> look_at(StoredJob job, const std::string& batch_id,
                                             const std::string& csv, const ChangeId& id);
  /// The id of a stored batch, the newest if none is named. Refuses a quarantined batch if the
  /// findings are to be applied.
  [[nodiscard]] Result<std::string> batch_to_diagnose(const std::string& cell,
                                                      const std::string& batch_id,
                                                      bool apply) const;

  CellBook cells_;
  Store& store_;
  ModelRegistry& registry_;
  const TrainerOptions options_;
  std::atomic<int> queue_capacity_;
  mutable Mutex keep_mutex_;
  KeepRule keep_ TRAMMEL_GUARDED_BY(keep_mutex_);
  ModelHistory history_;
  TroubleListener trouble_listener_;
  ProgressBook book_;
  JobRunner runner_;
  JobQueue queue_;
  std::optional<std::vector<StoredJob>> taken_up_;  // between take_up() and start()
  Mutex submit_mutex_;  // one caller at a time between the check of the store and the push
  Presence presence_;
  std::atomic<bool> is_present_ = false;  // the others know of this server
  Mutex agree_mutex_;
  std::int64_t descriptions_ TRAMMEL_GUARDED_BY(agree_mutex_) =
      -1;  // the descriptions already compared
  std::set<std::string> agreed_
      TRAMMEL_GUARDED_BY(agree_mutex_);  // cells with the record's files since this server began
  const std::int64_t began_at_;
  std::jthread worker_, keeper_, follower_, heartbeat_, reclaimer_;
};

}  // namespace trammel
