#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>

#include "server/measurement/checked_batch.h"
#include "server/registry/model_registry.h"
#include "server/store/store.h"
#include "server/trainer/acceptance/model_history.h"
#include "server/trainer/job_progress.h"
#include "server/trainer/pipeline/train.h"
#include "server/trainer/served_cells.h"
#include "server/trainer/trainer_options.h"

namespace trammel {

class JobBatches;
struct Diagnosis;

/// How a job learns that it is to end.
struct StopRequests {
  std::stop_token service;  ///< the service stops: the job goes on after the next start
  std::stop_token job;      ///< the job is cancelled
  [[nodiscard]] bool any() const { return service.stop_requested() || job.stop_requested(); }
};

/// What is done for one job: it is taken from the store, its batches are looked at, a model is made or a batch is
/// diagnosed, and the outcome is stored and reported. Of the queue's thread.
class JobRunner {
 public:
  /// The references outlive it.
  JobRunner(const ServedCells& cells, Store& store, const ModelRegistry& registry, ModelHistory& history,
            ProgressBook& book, const TrainerOptions& options);

  /// Ends the job, or puts it back where the service stops.
  void run(std::int64_t job, const StopRequests& stop);

 private:
  [[nodiscard]] Status attempt(std::int64_t id, const StopRequests& stop);
  [[nodiscard]] Status attempt_training(const StoredJob& job, JobBatches& batches, const StopRequests& stop);
  [[nodiscard]] Status attempt_diagnosis(const StoredJob& job, JobBatches& batches, bool apply,
                                         const StopRequests& stop);
  [[nodiscard]] Status apply(const StoredJob& job, JobBatches& batches, const CheckedBatch& batch,
                             const std::vector<std::string>& own, const Diagnosis& diagnosis, const StopRequests& stop);
  /// What the batch that this job came with says against the model in force; refuses, and puts the batch in quarantine,
  /// when it must not be learned from. Empty where nothing is to be said.
  [[nodiscard]] Result<std::string> hold_against_model_in_force(const StoredJob& job, JobBatches& batches);
  /// Reports at most every few milliseconds; answers false once it is to end.
  [[nodiscard]] std::function<bool(const std::string&, double)> reporter(const StoredJob& job,
                                                                         const StopRequests& stop);
  /// Of what the job asks for: level and bias, and where it asks for nothing special what the model in force has
  /// besides.
  [[nodiscard]] TrainOptions train_options(const StoredJob& job, const StopRequests& stop);
  /// Stores the candidate's model, in force if it is better, and reports the end of its job.
  [[nodiscard]] Status keep(Candidate candidate, const StopRequests& stop);
  void report_storing(const StoredJob& job);
  /// Ends a job that makes no model.
  [[nodiscard]] Status finish(const StoredJob& job, const std::string& message, const JobOutcome& outcome);

  const ServedCells& cells_;
  Store& store_;
  const ModelRegistry& registry_;
  ModelHistory& history_;
  ProgressBook& book_;
  const TrainerOptions options_;
};

}  // namespace trammel
