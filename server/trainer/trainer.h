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

/// The queue of trainings and diagnoses and the one thread that works on it: JobRunner does one
/// job, ModelHistory keeps what it makes. Everything accepted is in the store before it is
/// acknowledged; what a crash interrupts is taken up again at the next start, at most three times.
/// Thread-safe, take_up(), start() and stop() excepted.
///
/// Which rows are held out is drawn batch by batch: a row held out once is held out in every
/// training of that batch, so that the model in force and its successor are compared on poses of
/// all stored batches that neither was trained on (judge()). A batch that covers much less of the
/// joint ranges than the model in force, or fewer of its tools, teaches base and tool only; the
/// rest of that model stays.
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
  /// Announces the models in force of the store, loads as many as a second allows (the rest when
  /// they are asked for, or in the background), and queues unfinished jobs. Returns what could not
  /// be taken up, for the log: a model that does not load or was trained for another robot or tool,
  /// a job of a cell not served here, a job that was interrupted too often and is now failed.
  /// Requests may come as soon as it returns.
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
  /// From now on these cells are served too, with what the store has of them: the model in force,
  /// and the jobs that wait. Returns what could not be taken up, for the log. Thread-safe.
  [[nodiscard]] std::vector<std::string> add_cells(const ServedCells& more);
  /// From now on TrainerOptions::queue_capacity and TrainerOptions::keep are these. Thread-safe.
  void set_limits(int queue_capacity, const KeepRule& keep);
  /// The troubles of now: with the store, with its disk, with the models of cells; one sentence
  /// each. Never waits.
  [[nodiscard]] std::vector<std::string> troubles() const;

  /// Checks the batch against its cell, stores it with its job, queues it. When its turn comes it
  /// is held against the model in force (triage()): what must not be learned from goes into
  /// quarantine with the reason, and its job fails. Returns the job id; the same batch again
  /// returns the same, whoever sends it. Refuses what the batch reader and the cell refuse, an
  /// unknown cell (kNotFound), an id that the cell has with other content (kConflict) and too many
  /// poses (kTooLarge). However many jobs wait, a batch is taken.
  [[nodiscard]] Result<std::int64_t> submit(const std::string& cell, const std::string& batch_id,
                                            const std::string& csv, const std::string& request_id,
                                            const std::string& who = {});
  /// Tells whether batches of a training that is asked for leave quarantine. They do when its model
  /// is put in force, by itself or by a person, or when there are too few poses to judge it by; not
  /// where it is judged and found not better.
  enum class Quarantine { kStays, kReleased };
  /// Trains again from stored batches, together; none named = the newest one. Level and bias empty:
  /// as the cell says, and what the model in force has besides. Refuses batches that stay in
  /// quarantine and, where as many jobs that were asked for wait for this cell as may, everything
  /// (kBusy). Refuses, with the limit, what no training may ask for: more than max_poses, 1000
  /// batches, 500 error sources, a bias of more than 32 kernels.
  [[nodiscard]] Result<std::int64_t> retrain(const std::string& cell,
                                             const std::vector<std::string>& batch_ids,
                                             const std::string& level, const std::string& bias,
                                             Quarantine quarantine = Quarantine::kStays,
                                             const ChangeId& id = {});
  /// Diagnoses a stored batch (`batch_id`; empty: the newest) or `csv`: what the error sources of
  /// the model in force (of the cell, where there is none) do not explain. With `apply` trains the
  /// causes found beside them and puts the model in force only if it is better on the rows held out
  /// beyond chance. Returns the job; its findings are diagnosis(). Refuses as submit() and
  /// retrain() do, but takes a batch in quarantine.
  [[nodiscard]] Result<std::int64_t> diagnose(const std::string& cell, const std::string& batch_id,
                                              const std::string& csv, bool apply,
                                              const ChangeId& id = {});
  /// Holds a few poses against the model in force: whether the robot still is as that has it
  /// (check_health()). `tolerance_mm`: empty as the cell file says. Returns the job; what it found
  /// is diagnosis(). Refuses as diagnose(), and a cell without a model in force (kNotFound).
  [[nodiscard]] Result<std::int64_t> check(const std::string& cell, const std::string& batch_id,
                                           const std::string& csv,
                                           std::optional<double> tolerance_mm,
                                           const ChangeId& id = {});
  /// The findings of a job whose diagnosis or check is found; kBusy while it is not.
  [[nodiscard]] Result<StoredDiagnosis> diagnosis(std::int64_t job) const;
  /// Ends a job that waits or runs, here or on another server of the same store: its outcome is
  /// kCancelled, and nothing of it is stored but the findings that a diagnosis already had. The
  /// batch that came with it stays, to be trained from when somebody asks. Returns once a waiting
  /// job is stored as ended; a running one ends within a second. Refuses an unknown job (kNotFound)
  /// and one that is over (kConflict).
  [[nodiscard]] Status cancel(std::int64_t job, const ChangeId& by = {});
  /// Lets trainings take a batch that was kept out because it did not fit the model in force.
  [[nodiscard]] Status release(const std::string& cell, const std::string& batch_id,
                               const ChangeId& id = {});
  /// Nothing takes the batch any more.
  [[nodiscard]] Status discard(const std::string& cell, const std::string& batch_id,
                               const ChangeId& id = {});
  /// All batches, without their text, of one cell or (empty) of all, oldest first.
  [[nodiscard]] Result<std::vector<StoredBatch>> batches(const std::string& cell) const;
  /// Those that are kept out.
  [[nodiscard]] Result<std::vector<StoredBatch>> quarantined(const std::string& cell) const;
  /// See ModelHistory.
  /// Tell it what the cells are asked for.
  [[nodiscard]] RecentPoses& recent_poses() { return history_.recent_poses(); }
  /// See ModelHistory. Any version is judged first, as a new one would be: where it is worse on the
  /// same poses than the one in force it is refused with the figures, unless `force` says that it
  /// is wanted. So is an imported one that cannot be judged.
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
  /// A job with what was asked for and when.
  struct DatedJob {
    StoredJob asked;
    JobProgress progress;
  };
  /// The jobs of one cell or (empty) of all, oldest first: those that wait or run, and the last
  /// ones that ended.
  [[nodiscard]] Result<std::vector<DatedJob>> jobs(const std::string& cell) const;
  /// Those that wait or run, oldest first, as they go on. From memory.
  [[nodiscard]] std::vector<JobProgress> unfinished_jobs() const { return book_.unfinished(); }
  /// The troubles with the models that cells are served with; see ModelHistory.
  [[nodiscard]] std::map<std::string, CellTrouble> cell_troubles() const;
  /// Why this server may not answer for the cell though it has its files; empty: it may.
  [[nodiscard]] std::optional<std::string> why_apart(const std::string& cell) const {
    return cells_.why_apart(cell);
  }
  /// This server's description of itself.
  [[nodiscard]] ServerSelf self() const;
  /// The servers of the record, this one among them, as they were heard of last, without what they
  /// serve. From memory.
  [[nodiscard]] std::vector<ServerInRecord> servers_seen() const;
  /// The servers of the record with what they serve, as the record has it now.
  [[nodiscard]] Result<std::vector<ServerInRecord>> servers() const;
  /// Waiting, without the one being trained.
  [[nodiscard]] int queued_jobs() const;

 private:
  /// Checks the batch (its text, and when it was accepted first), stores it with its job, queues
  /// it.
  [[nodiscard]] Result<std::int64_t> take_in(StoredBatch batch);
  /// Loads models in the background, tries a store again that cannot be written, and tells of other
  /// troubles than `told`.
  void keep_up(std::vector<std::string> told, const std::stop_token& stop);
  /// Prunes what the rule lets go of, one small change after the other.
  void prune(const std::string& cell, const std::stop_token& stop);
  /// Takes up a store that can be read only now.
  void take_up_late();
  /// Where several servers share the store: takes up what others changed, and keeps the claim on
  /// the job that runs.
  void follow(std::int64_t followed, const std::stop_token& stop);
  /// Takes up what is in force since `followed` changes, of so many that were `made`; returns how
  /// many it has taken up.
  [[nodiscard]] std::int64_t follow_models(std::int64_t followed, std::int64_t made);
  /// Which jobs wait, run elsewhere or are over.
  void follow_jobs();
  /// Tells of a job that is known here what became of it elsewhere.
  void follow_job(const StoredJob& job);
  /// Compares the files of its cells with the record where either may have changed, and sets those
  /// apart that differ. `descriptions`: how many there ever were.
  void agree(std::int64_t descriptions) TRAMMEL_EXCLUDES(agree_mutex_);
  /// Tells the others that it is there, and keeps the claim on the job that runs. Waits for nobody
  /// else's work.
  void beat(const std::stop_token& stop);
  /// As it sees itself: nobody else has its store.
  [[nodiscard]] ServerInRecord alone() const;
  [[nodiscard]] Status cancel_in_record(const StoredJob& job, const ChangeId& by);
  /// Ends the computing of a job that is no longer this server's, or that somebody cancelled on
  /// another one.
  void keep_claim();
  /// Those of cells that are served, as far as they do not wait here already.
  void take_up_jobs(std::vector<StoredJob> jobs, std::vector<std::string>& notices)
      TRAMMEL_REQUIRES(submit_mutex_);
  void tell_troubles(std::vector<std::string>& told);
  /// Refuses (kBusy) where as many jobs that were asked for wait for this cell as may.
  [[nodiscard]] Status check_room(const std::string& cell) const;
  /// The progress of a job as the store has it.
  [[nodiscard]] JobProgress stored_progress(const StoredJob& job) const;
  /// The job that was queued under this id before; empty: none.
  [[nodiscard]] Result<std::optional<std::int64_t>> queued_before(const ChangeId& id) const;
  void enqueue(const StoredJob& job, bool asked_for);
  /// True if somebody asked for the job; else it came with its batch.
  [[nodiscard]] Result<bool> was_asked_for(const StoredJob& job) const;
  /// True if an unfinished job of the store is to be worked on; else a notice says why not.
  [[nodiscard]] Result<bool> can_take_up(const StoredJob& job, std::vector<std::string>& notices);
  /// A version held against the one in force on what the cell measured; empty: there is nothing to
  /// hold it against.
  [[nodiscard]] Result<std::optional<GateVerdict>> judged_beside_present(const std::string& cell,
                                                                         int version) const;
  /// Refuses what the verdict finds worse, or not to be told.
  [[nodiscard]] Status check_not_worse(const std::string& cell, int version,
                                       const GateVerdict& verdict) const;
  /// Checks that the stored batches may be trained from together.
  [[nodiscard]] Status check_together(const std::vector<StoredBatch>& stored,
                                      const std::vector<std::string>& batch_ids,
                                      bool release) const;
  /// Queues a job that looks at one batch and learns nothing from it, unless it is to `apply` what
  /// it finds.
  [[nodiscard]] Result<std::int64_t> look_at(StoredJob job, const std::string& batch_id,
                                             const std::string& csv, const ChangeId& id);
  /// The id of a stored batch, of the newest where none is named; refused in quarantine where what
  /// is found in it is to be applied.
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
  Mutex
      submit_mutex_;  // one at a time between the look at what is there and the push: who may push
  Presence presence_;
  std::atomic<bool> is_present_ = false;  // the others know of it
  Mutex agree_mutex_;
  std::int64_t descriptions_ TRAMMEL_GUARDED_BY(agree_mutex_) =
      -1;  // those that it has compared with
  std::set<std::string> agreed_
      TRAMMEL_GUARDED_BY(agree_mutex_);  // cells whose files were the record's since it began
  const std::int64_t began_at_;
  std::jthread worker_, keeper_, follower_, heartbeat_, reclaimer_;
};

}  // namespace trammel
