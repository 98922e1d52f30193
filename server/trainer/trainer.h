#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "server/base/bounded_queue.h"
#include "server/registry/model_registry.h"
#include "server/store/store.h"
#include "server/trainer/acceptance/gate.h"
#include "server/trainer/pipeline/train.h"

namespace trammel {

struct Diagnosis;

struct TrainerOptions {
  int queue_capacity = 16;        ///< jobs waiting; one more is refused (kBusy) and nothing is stored
  int max_poses = 5000;           ///< of one training, all its batches together; memory grows with the square
  double validation_share = 0.2;  ///< of the poses of a batch are held out to judge models by (judging_rows())
  double accept_ratio = 1.02;     ///< see GateOptions
  std::uint64_t seed = 1;
};

enum class JobStage { kQueued, kTraining, kStoring, kDone, kFailed };

/// What a watcher sees of one job.
struct JobProgress {
  std::int64_t job = 0;
  std::string cell;
  JobStage stage = JobStage::kQueued;
  std::string what;       ///< `geometry, iteration 4`, or the outcome
  double share = 0;       ///< [0, 1]
  int model_version = 0;  ///< once done
  bool in_force = false;
};

/// The queue of trainings and diagnoses and the one thread that works on it. Everything accepted is in the store before
/// it is acknowledged; what a crash interrupts is taken up again at the next start, at most three times. Thread-safe,
/// take_up(), start() and stop() excepted.
///
/// Which rows are held out is drawn batch by batch: a row held out once is held out in every training of that batch, so
/// that the model in force and its successor are compared on poses of all stored batches that neither was trained on
/// (judge()). A batch that covers much less of the joint ranges than the model in force, or fewer of its tools, teaches
/// base and tool only; the rest of that model stays.
class Trainer {
 public:
  /// Called by whichever thread changes the job; for one job never by two at a time.
  using ProgressListener = std::function<void(const JobProgress&)>;
  /// A model was stored (in_force: and put in force). Called in the order of the changes, while no other can happen: it
  /// must not call back into what changes models.
  using ModelListener = std::function<void(const ServedModel&, bool in_force)>;

  /// `store` and `registry` outlive it.
  Trainer(std::map<std::string, std::shared_ptr<const Cell>> cells, Store& store, ModelRegistry& registry,
          TrainerOptions options);
  ~Trainer();  ///< stops as stop()

  /// Set before start().
  void set_listeners(ProgressListener progress, ModelListener model);
  /// Publishes the models in force from the store and queues unfinished jobs. Returns what could not be taken up, for
  /// the log: a model that does not load or was trained for another robot or tool, a job of a cell not served here, a
  /// job that was interrupted too often and is now failed. Requests may come as soon as it returns.
  [[nodiscard]] Result<std::vector<std::string>> take_up();
  /// Reports the jobs taken up and starts the worker. Does take_up() itself where that has not been done.
  [[nodiscard]] Result<std::vector<std::string>> start();
  /// Asks the running training to give up (its job stays queued in the store) and joins.
  void stop();

  [[nodiscard]] const std::map<std::string, std::shared_ptr<const Cell>>& cells() const { return cells_; }

  /// Checks the batch against its cell, stores it with its job, queues it. When its turn comes it is held against the
  /// model in force (triage()): what must not be learned from goes into quarantine with the reason, and its job fails.
  /// Returns the job id; the same request again returns the same. Refuses what the batch reader and the cell refuse, an
  /// unknown cell (kNotFound), an id that the cell already has (kConflict), too many poses (kTooLarge) and, while the
  /// queue is full, everything new (kBusy).
  [[nodiscard]] Result<std::int64_t> submit(const std::string& cell, const std::string& batch_id,
                                            const std::string& csv, const std::string& request_id);
  /// Whether batches of a training that is asked for leave quarantine. They do when its model is put in force, by
  /// itself or by a person, or when there are too few poses to judge it by; not where it is judged and found not
  /// better.
  enum class Quarantine { kStays, kReleased };
  /// Trains again from stored batches, together; none named = the newest one. Level and bias empty: as the cell says,
  /// and what the model in force has besides. Refuses batches that stay in quarantine.
  [[nodiscard]] Result<std::int64_t> retrain(const std::string& cell, const std::vector<std::string>& batch_ids,
                                             const std::string& level, const std::string& bias,
                                             Quarantine quarantine = Quarantine::kStays);
  /// Diagnoses a stored batch (`batch_id`; empty: the newest) or `csv`: what the error sources of the model in force
  /// (of the cell, where there is none) do not explain. With `apply` trains the causes found beside them and puts the
  /// model in force only if it is better on the rows held out beyond chance. Returns the job; its findings are
  /// diagnosis(). Refuses as submit() and retrain() do, but takes a batch in quarantine.
  [[nodiscard]] Result<std::int64_t> diagnose(const std::string& cell, const std::string& batch_id,
                                              const std::string& csv, bool apply);
  /// Of a job whose diagnosis is found; kBusy while it is not.
  [[nodiscard]] Result<StoredDiagnosis> diagnosis(std::int64_t job) const;
  /// Lets trainings take a batch that was kept out because it did not fit the model in force.
  [[nodiscard]] Status release(const std::string& cell, const std::string& batch_id);
  /// The batches that are kept out, without their text, of one cell or (empty) of all.
  [[nodiscard]] Result<std::vector<StoredBatch>> quarantined(const std::string& cell) const;
  /// Puts a stored version in force and publishes it.
  [[nodiscard]] Status activate(const std::string& cell, int version);
  /// Back to the version in force before, or the last one before it that can be served; returns it.
  [[nodiscard]] Result<int> rollback(const std::string& cell);
  /// A stored version of a cell that is served here; refused when its robot or its tools are not the cell's any more.
  [[nodiscard]] Result<CompensatedModel> load_for_service(const std::string& cell, int version) const;
  /// Takes a model file from elsewhere into the history, not in force; returns its version, the present one when the
  /// same model is there already. Refuses one of another cell, robot or tool.
  [[nodiscard]] Result<int> import_model(const std::string& cell, const std::string& text);

  /// Of an unfinished job as it goes on, of a finished one from the store.
  [[nodiscard]] Result<JobProgress> progress(std::int64_t job) const;
  /// A job with what was asked for and when.
  struct DatedJob {
    StoredJob asked;
    JobProgress progress;
  };
  /// Of one cell or (empty) of all, oldest first: those that wait or run, and the last ones that ended.
  [[nodiscard]] Result<std::vector<DatedJob>> jobs(const std::string& cell) const;
  /// Waiting, without the one being trained.
  [[nodiscard]] int queued_jobs() const;

 private:
  [[nodiscard]] Result<std::shared_ptr<const Cell>> cell(const std::string& name) const;
  [[nodiscard]] Status check_room() const;
  void enqueue(const StoredJob& job);
  /// Whether an unfinished job of the store is to be worked on; else a notice says why not.
  [[nodiscard]] Result<bool> can_take_up(const StoredJob& job, std::vector<std::string>& notices);

  [[nodiscard]] Status publish_from_store(const std::string& cell);
  void put_in_force(std::shared_ptr<const ServedModel> model);
  /// The version marked in force, where it could not be loaded.
  [[nodiscard]] Result<std::optional<StoredModel>> record_not_loaded(const std::string& cell) const;
  /// The last versions that served the cell before the one in force, as far as they load.
  [[nodiscard]] Result<std::vector<ServedModel>> served_before(const std::string& cell) const;

  void work(const std::stop_token& stop);
  void run(std::int64_t job, const std::stop_token& stop);
  [[nodiscard]] Status attempt(std::int64_t job, const std::stop_token& stop);
  [[nodiscard]] Result<MeasurementBatch> load_batches(const StoredJob& job, const Cell& cell) const;
  [[nodiscard]] Status attempt_diagnosis(const StoredJob& job, const std::shared_ptr<const Cell>& cell,
                                         JobProgress progress, const std::stop_token& stop);
  [[nodiscard]] Result<MeasurementBatch> batch_to_diagnose(const StoredJob& job, const StoredDiagnosis& asked,
                                                           const Cell& cell) const;
  /// What the batch that this job came with says against the model in force; refuses, and puts the batch in quarantine,
  /// when it must not be learned from. Empty where nothing is to be said.
  [[nodiscard]] Result<std::string> hold_against_model_in_force(const StoredJob& job, const Cell& cell);
  [[nodiscard]] std::function<bool(const std::string&, double)> reporter(const JobProgress& progress,
                                                                         const std::stop_token& stop);
  [[nodiscard]] TrainOptions train_options(const StoredJob& job, const Cell& cell, const JobProgress& progress,
                                           const std::stop_token& stop);
  /// The model that the job asks for, from `batch`. Where the job asks for nothing special and the batch covers much
  /// less than the model in force, that model with base and tool refitted; `note` then says so.
  [[nodiscard]] Result<CompensatedModel> trained(const StoredJob& job, const MeasurementBatch& batch,
                                                 TrainOptions options, std::string& note) const;
  /// Stores the model and, if judge() says so, puts it in force. `note` goes with the outcome; poses that fit neither
  /// model by a `diagnosis` do not judge.
  [[nodiscard]] Status keep(const CompensatedModel& model, JobProgress progress, Bar bar, const std::string& note,
                            const Diagnosis* diagnosis = nullptr);
  /// The stored batches whose rows may judge what `job` makes: not in quarantine, not waiting, nothing that failed.
  [[nodiscard]] Result<std::vector<JudgingSession>> judging_sessions(const StoredJob& job) const;
  /// That of the batch that a diagnosis was of; appended where it is not among them.
  [[nodiscard]] Result<JudgingSession*> session_of_diagnosis(const StoredJob& job,
                                                             std::vector<JudgingSession>& sessions) const;
  /// Of the model against `present`; null: none in force.
  [[nodiscard]] Result<GateVerdict> verdict(const CompensatedModel& model, const ServedModel* present,
                                            const std::vector<JudgingSession>& sessions, const std::string& cell,
                                            Bar bar) const;
  /// Ends a job that makes no model.
  [[nodiscard]] Status finish(JobProgress progress, const std::string& outcome);
  void report(const JobProgress& progress);

  const std::map<std::string, std::shared_ptr<const Cell>> cells_;
  Store& store_;
  ModelRegistry& registry_;
  const TrainerOptions options_;
  ProgressListener on_progress_;
  ModelListener on_model_;
  std::unique_ptr<BoundedQueue<std::int64_t>> queue_;
  std::optional<std::vector<StoredJob>> taken_up_;  // between take_up() and start()
  std::mutex submit_mutex_;      // one at a time between the look at the queue's room and the push: who may push
  std::mutex activation_mutex_;  // one change of what is in force at a time
  mutable std::mutex progress_mutex_;
  std::map<std::int64_t, JobProgress> progress_;  // guarded by progress_mutex_: unfinished jobs
  std::jthread worker_;
};

/// Refused while the batch is in quarantine: nothing is learned from it.
[[nodiscard]] Status check_released(const StoredBatch& batch);
/// Read and checked against its cell.
[[nodiscard]] Result<MeasurementBatch> checked_batch(const StoredBatch& stored, const Cell& cell);

}  // namespace trammel
