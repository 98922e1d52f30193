#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "server/registry/model_registry.h"
#include "server/store/store.h"
#include "server/trainer/cell_book.h"
#include "server/trainer/compute/compute_process.h"
#include "server/trainer/job_progress.h"
#include "server/trainer/model_history.h"
#include "server/trainer/trainer_options.h"

namespace trammel {

constexpr int kMaxAttempts = 3;  // of a job with a computation or process that breaks off

/// Does one job: takes it from the store, computes it (in a process of its own), stores the outcome
/// and reports it. An outcome that the disk does not accept now waits: a job is reported as
/// finished only if the store has it so. For the queue's thread.
class JobRunner {
 public:
  /// The references outlive it.
  JobRunner(const CellBook& cells, Store& store, const ModelRegistry& registry,
            ModelHistory& history, ProgressBook& book, const TrainerOptions& options);

  using CancelledBy = std::function<std::string()>;
  enum class End {
    kOver,      ///< it has an outcome
    kAgain,     ///< it is queued again: its computation broke off, or the service stops
    kElsewhere  ///< another server works on it, or on another job of its cell
  };
  /// `cancelled_by` names the person who requested its end, if any.
  [[nodiscard]] End run(std::int64_t job, const StopRequests& stop,
                        const CancelledBy& cancelled_by);
  /// The job that is this server's now, until it is over; 0: none. Thread-safe.
  [[nodiscard]] std::int64_t claimed() const { return claimed_; }
  /// That job no longer belongs to this server: its attempt here leaves no trace. Thread-safe.
  void lose_claim(std::int64_t job) { lost_ = job; }

 private:
  /// The end of an attempt that made nothing.
  struct Failed {
    Error error;
    JobVerdict verdict = JobVerdict::kRefused;
    bool again = false;  ///< a broken-off job is repeated only once
    ComputeCost cost = {};
    bool elsewhere = false;  ///< it was not begun
  };
  using Attempt = tl::expected<void, Failed>;

  [[nodiscard]] Attempt attempt(std::int64_t id, const StopRequests& stop);
  [[nodiscard]] Attempt compute(const StoredJob& job, const StopRequests& stop);
  /// The task from which the job is computed, but its batches.
  [[nodiscard]] Result<ComputeTask> task_of(const StoredJob& job) const;
  [[nodiscard]] std::optional<FleetPrior> fleet_prior_of(const StoredJob& job) const;
  /// True if the job came with its batch; otherwise a person requested it, knowing the batch.
  [[nodiscard]] Result<bool> came_with_batch(const StoredJob& job) const;
  /// True if the job learns only from its own batches, because somebody named them.
  [[nodiscard]] Result<bool> learns_alone(const StoredJob& job, bool came_with_batch) const;
  [[nodiscard]] Status give_batches(Computing& computing, const StoredJob& job,
                                    const std::vector<std::string>& earlier) const;
  [[nodiscard]] Attempt keep(const StoredJob& job, const Made& made, Computing& computing,
                             const StopRequests& stop);
  [[nodiscard]] Attempt quarantine(const StoredJob& job, const std::string& why,
                                   const ComputeCost& cost, const StopRequests& stop);
  /// Ends a job that makes no model.
  [[nodiscard]] Attempt finish(const StoredJob& job, const Made& made, const ComputeCost& cost,
                               const StopRequests& stop);

  [[nodiscard]] End end(std::int64_t id, const Failed& failed, const StopRequests& stop,
                        const CancelledBy& cancelled_by);
  [[nodiscard]] End put_back(const StoredJob& job, const std::string& why, bool attempt_counts,
                             const StopRequests& stop);
  [[nodiscard]] Failed failed_by(const Computing& computing, const Error& error) const;

  /// Repeats a call to the store until the store does it or refuses it, and waits while the disk
  /// does not allow it. An error of the disk is returned only if the job must end.
  template <typename Work>
  [[nodiscard]] auto once_the_disk_lets(std::int64_t job, const StopRequests& stop,
                                        const Work& work) -> decltype(work());
  void report_waiting(std::int64_t job, const Error& why);
  /// Reports at most every few milliseconds; answers false once the job is to end.
  [[nodiscard]] std::function<bool(const std::string&, double)> reporter(const StoredJob& job,
                                                                         const StopRequests& stop);

  const CellBook& cells_;
  Store& store_;
  const ModelRegistry& registry_;
  ModelHistory& history_;
  ProgressBook& book_;
  const TrainerOptions options_;
  std::atomic<std::int64_t> claimed_ = 0;
  std::atomic<std::int64_t> lost_ = 0;
};

}  // namespace trammel
