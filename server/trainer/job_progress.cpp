#include "server/trainer/job_progress.h"

namespace trammel {

namespace {

JobStage stage_of(JobState state) {
  switch (state) {
    case JobState::kQueued:
      return JobStage::kQueued;
    case JobState::kRunning:
      return JobStage::kTraining;
    case JobState::kDone:
      return JobStage::kDone;
    case JobState::kFailed:
      return JobStage::kFailed;
  }
  return JobStage::kFailed;
}

}  // namespace

JobProgress progress_of(const StoredJob& job) {
  JobProgress progress;
  progress.job = job.id;
  progress.cell = job.cell;
  progress.stage = stage_of(job.state);
  const bool is_elsewhere =
      job.state == JobState::kRunning && job.message.empty() && !job.server.empty();
  progress.what = is_elsewhere ? "on " + job.server : job.message;
  progress.share = job.state == JobState::kDone ? 1 : 0;
  progress.model_version = job.model_version;
  progress.outcome = job.outcome;
  return progress;
}

JobOutcome cancelled_outcome(const std::string& who) {
  JobOutcome outcome;
  outcome.verdict = JobVerdict::kCancelled;
  outcome.why = who.empty() ? "cancelled on request" : "cancelled by " + who;
  return outcome;
}

JobOutcome failed_outcome(const Error& error, JobVerdict verdict) {
  JobOutcome outcome;
  outcome.verdict = verdict;
  outcome.code = error.code;
  Error why = error;
  why.next.clear();
  outcome.why = sentence(why);
  outcome.next = error.next;
  return outcome;
}

void ProgressBook::report(const JobProgress& progress) {
  {
    const MutexLock lock(mutex_);
    const bool finished = progress.stage == JobStage::kDone || progress.stage == JobStage::kFailed;
    if (finished) {
      unfinished_.erase(progress.job);
    } else {
      unfinished_[progress.job] = progress;
    }
  }
  if (listener_) listener_(progress);
}

std::vector<JobProgress> ProgressBook::unfinished() const {
  const MutexLock lock(mutex_);
  std::vector<JobProgress> all;
  for (const auto& [id, progress] : unfinished_) all.push_back(progress);
  return all;
}

std::optional<JobProgress> ProgressBook::find(std::int64_t job) const {
  const MutexLock lock(mutex_);
  const auto found = unfinished_.find(job);
  return found == unfinished_.end() ? std::nullopt : std::optional(found->second);
}

}  // namespace trammel
