#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "server/base/mutex.h"
#include "server/store/store.h"

namespace trammel {

enum class JobStage { kQueued, kTraining, kStoring, kDone, kFailed };

/// JobProgress::what of a job (kStoring) while its model is compared with others.
inline constexpr const char* kJudging = "judging";

/// The view that a watcher has of one job.
struct JobProgress {
  std::int64_t job = 0;
  std::string cell;
  JobStage stage = JobStage::kQueued;
  std::string what;       ///< `geometry, iteration 4`, or the outcome
  double share = 0;       ///< [0, 1]
  int model_version = 0;  ///< once done
  bool in_force = false;
  JobOutcome outcome = {};  ///< for a job that has ended
};

/// The progress as stored; `in_force` is left false.
[[nodiscard]] JobProgress progress_of(const StoredJob& job);

/// The outcome of a job that somebody ended.
[[nodiscard]] JobOutcome cancelled_outcome(const std::string& who);
/// The outcome of a job that ended with `error`.
[[nodiscard]] JobOutcome failed_outcome(const Error& error, JobVerdict verdict);

/// The progress of the unfinished jobs. Thread-safe, set_listener() excepted.
class ProgressBook {
 public:
  /// Called by whichever thread changes the job, without a lock.
  using Listener = std::function<void(const JobProgress&)>;

  void set_listener(Listener listener) { listener_ = std::move(listener); }
  /// Tells the listener; a job that is over is forgotten.
  void report(const JobProgress& progress);
  /// Empty where the job is over or unknown.
  [[nodiscard]] std::optional<JobProgress> find(std::int64_t job) const;
  /// Oldest first.
  [[nodiscard]] std::vector<JobProgress> unfinished() const;

 private:
  Listener listener_;
  mutable Mutex mutex_;
  std::map<std::int64_t, JobProgress> unfinished_ TRAMMEL_GUARDED_BY(mutex_);
};

}  // namespace trammel
