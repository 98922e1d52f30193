#pragma once

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "server/base/bounded_queue.h"
#include "server/registry/model_registry.h"
#include "server/store/store.h"
#include "server/trainer/train.h"

namespace trammel {

struct TrainerOptions {
  int queue_capacity = 16;        ///< jobs waiting; one more is refused (kBusy) and nothing is stored
  double validation_share = 0.2;  ///< of the rows of a batch without `set` column
  double accept_ratio = 1.02;     ///< put in force only if held-out rms <= this times that of the model in force
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

/// The queue of trainings and the one thread that works on it. Everything accepted is in the store before it is
/// acknowledged; what a crash interrupts is taken up again at the next start. Thread-safe.
class Trainer {
 public:
  using ProgressListener = std::function<void(const JobProgress&)>;          ///< called from the worker thread
  using ModelListener = std::function<void(const ServedModel&, bool in_force)>;  ///< a model was stored or put in force

  Trainer(std::map<std::string, std::shared_ptr<const Cell>> cells, Store& store, ModelRegistry& registry,
          TrainerOptions options);
  ~Trainer();  ///< stops as stop()

  /// Set before start().
  void set_listeners(ProgressListener progress, ModelListener model);
  /// Publishes the models in force from the store, queues unfinished jobs, starts the worker.
  [[nodiscard]] Status start();
  /// Asks the running training to give up (its job stays queued in the store) and joins.
  void stop();

  [[nodiscard]] const std::map<std::string, std::shared_ptr<const Cell>>& cells() const { return cells_; }

  /// Checks the batch against its cell, stores it with its job, queues it. Returns the job id.
  [[nodiscard]] Result<std::int64_t> submit(const std::string& cell, const std::string& batch_id,
                                            const std::string& csv, const std::string& request_id);
  /// Trains again from stored batches; none named = the newest batch.
  [[nodiscard]] Result<std::int64_t> retrain(const std::string& cell, const std::vector<std::string>& batch_ids,
                                             const std::string& level, const std::string& bias);
  /// Puts a stored version in force and publishes it.
  [[nodiscard]] Status activate(const std::string& cell, int version);
  /// Back to the version in force before; returns it.
  [[nodiscard]] Result<int> rollback(const std::string& cell);
  /// Takes a model file from elsewhere into the history, not in force. Refuses one of another cell.
  [[nodiscard]] Result<int> import_model(const std::string& cell, const std::string& text);

  /// Of a job that this process knows, else from the store.
  [[nodiscard]] Result<JobProgress> progress(std::int64_t job) const;

 private:
  void work(const std::stop_token& stop);
  void run(std::int64_t job, const std::stop_token& stop);
  void report(const JobProgress& progress);

  const std::map<std::string, std::shared_ptr<const Cell>> cells_;
  Store& store_;
  ModelRegistry& registry_;
  const TrainerOptions options_;
  ProgressListener on_progress_;
  ModelListener on_model_;
  BoundedQueue<std::int64_t> queue_;
  std::mutex activation_mutex_;  // one change of what is in force at a time
  mutable std::mutex progress_mutex_;
  std::map<std::int64_t, JobProgress> progress_;  // guarded by progress_mutex_
  std::jthread worker_;
};

}  // namespace trammel
