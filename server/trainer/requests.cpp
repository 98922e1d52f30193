// The requests to a trainer: batches, trainings, diagnoses and checks are taken in as jobs, and
// jobs are ended.
#include <algorithm>
#include <set>
#include <utility>

#include "server/base/hash.h"
#include "server/base/name_check.h"
#include "server/base/units.h"
#include "server/base/unix_time.h"
#include "server/bias/kernels/kernel_spelling.h"
#include "server/error_sources/spelling.h"
#include "server/tasks/accept/judging.h"
#include "server/trainer/compute/job_batches.h"
#include "server/trainer/job_sources.h"
#include "server/trainer/trainer.h"

namespace trammel {
namespace {

constexpr std::size_t kMaxSources = 500;  // as in a cell file

Status check_batch_id(const std::string& id) {
  if (id.empty()) return refused("a batch needs an id").of("batch");
  return check_name(id, "batch");
}

std::int64_t the_job(const std::optional<std::int64_t>& job) { return *job; }

Status check_most(const char* field, std::size_t asked, std::size_t most, const char* of_what) {
  if (asked <= most) return {};
  return failure(ErrorCode::kTooLarge, "{} {}, limit {}", asked, of_what, most)
      .of(field)
      .beyond(asked, most);
}

/// Level and bias of a training that is asked for; empty: as usual.
Status check_spellings(const Cell& cell, const std::string& level, const std::string& bias) {
  if (!level.empty()) {
    TRY(check_most("level", level.size(), kMostSpellingBytes, "bytes"));
    const auto specs = TRY(parse_level(level));
    TRY(check_most("level", specs.size(), kMaxSources, "error sources"));
    for (const std::string& spec : spelled_out(specs, cell)) {
      if (spec == kAutoSources) continue;
      TRY(make_error_source(spec, cell));
    }
  }
  return bias.empty() ? Status() : check_bias_spelling(bias);
}

}  // namespace

Result<std::int64_t> Trainer::submit(const std::string& cell_name, const std::string& batch_id,
                                     const std::string& csv, const std::string& request_id,
                                     const std::string& who) {
  StoredBatch batch{cell_name, batch_id, csv, "", request_id, unix_now()};
  batch.who = who;
  return take_in(std::move(batch));
}

Result<std::int64_t> Trainer::take_in(StoredBatch batch) {
  const auto cell = TRY(cells_.find(batch.cell));
  TRY(check_batch_id(batch.id));
  const auto received = TRY(received_batch(
      {batch.id, batch.csv, batch.accepted_at}, *cell,
      held_out_by_service(options_.validation_share, options_.seed), options_.compute.reads));
  batch.poses = static_cast<int>(received.size());
  if (batch.poses > options_.max_poses) {
    return failure(ErrorCode::kTooLarge, "batch {} has {} poses, limit {}", batch.id, batch.poses,
                   options_.max_poses)
        .of("poses")
        .beyond(batch.poses, options_.max_poses);
  }
  batch.hash = sha256_hex(batch.csv);
  StoredJob job;
  job.cell = batch.cell;
  job.batch_ids = {batch.id};
  job.created_at = unix_now();

  const MutexLock lock(submit_mutex_);
  const auto accepted = TRY(store_.add_batch(batch, job));
  if (!accepted.is_repeat) enqueue(accepted, false);
  return accepted.id;
}

Result<std::int64_t> Trainer::diagnose(const std::string& cell_name, const std::string& batch_id,
                                       const std::string& csv, bool apply, const ChangeId& id) {
  StoredJob job;
  job.asked = AskedDiagnosis{apply};
  job.cell = cell_name;
  return look_at(std::move(job), batch_id, csv, id);
}

Result<std::int64_t> Trainer::check(const std::string& cell_name, const std::string& batch_id,
                                    const std::string& csv, std::optional<double> tolerance_mm,
                                    const ChangeId& id) {
  if (cells_.find(cell_name) && !registry_.in_force(cell_name))
    return failure(ErrorCode::kNotFound, "cell {} has no model in force to hold a check against",
                   cell_name)
        .of("cell");
  StoredJob job;
  job.asked = AskedCheck{tolerance_mm ? std::optional(*tolerance_mm * from_mm(1)) : std::nullopt};
  job.cell = cell_name;
  return look_at(std::move(job), batch_id, csv, id);
}

Result<std::int64_t> Trainer::look_at(StoredJob job, const std::string& batch_id,
                                      const std::string& csv, const ChangeId& id) {
  const std::string& cell_name = job.cell;
  const bool apply = is_to_train(job.asked);
  if (const auto before = queued_before(id); !before || *before) return before.map(the_job);
  const auto cell = TRY(cells_.find(cell_name));
  if (!batch_id.empty() && !csv.empty()) {
    return failure(ErrorCode::kUsage,
                   "a {} is of a stored batch or of one that is sent, not of both",
                   job.kind() == JobKind::kCheck ? "check" : "diagnosis");
  }
  job.created_at = unix_now();
  if (csv.empty()) {
    const auto stored = TRY(batch_to_diagnose(cell_name, batch_id, apply));
    job.batch_ids = {stored};
  } else {
    const auto batch =
        TRY(received_batch({"", csv, job.created_at}, *cell,
                           held_out_of_diagnosis(options_.validation_share, options_.seed, apply),
                           options_.compute.reads));
    if (const auto poses = static_cast<int>(batch.size()); poses > options_.max_poses) {
      return failure(ErrorCode::kTooLarge, "the batch has {} poses, limit {}", poses,
                     options_.max_poses)
          .of("poses")
          .beyond(poses, options_.max_poses);
    }
  }
  const MutexLock lock(submit_mutex_);
  if (const auto before = queued_before(id); !before || *before)
    return before.map(the_job);  // meanwhile
  TRY(check_room(cell_name));
  const auto accepted = TRY(store_.add_diagnosis(job, csv, id));
  enqueue(accepted, true);
  return accepted.id;
}

Result<std::string> Trainer::batch_to_diagnose(const std::string& cell_name,
                                               const std::string& batch_id, bool apply) const {
  const auto stored = TRY(store_.batches(cell_name));
  if (stored.empty())
    return failure(ErrorCode::kNotFound, "cell {} has no batch to diagnose", cell_name).of("batch");
  const std::string& id = batch_id.empty() ? stored.back().id : batch_id;
  if (!apply) return id;
  const auto asked = TRY(store_.batch_record(cell_name, id));
  TRY(check_released(asked));
  return id;
}

Result<std::int64_t> Trainer::retrain(const std::string& cell_name,
                                      const std::vector<std::string>& batch_ids,
                                      const std::string& level, const std::string& bias,
                                      Quarantine quarantine, const ChangeId& id) {
  if (const auto before = queued_before(id); !before || *before) return before.map(the_job);
  const auto cell = TRY(cells_.find(cell_name));
  TRY(check_spellings(*cell, level, bias));
  TRY(check_most("batches", batch_ids.size(), kMostBatches, "batches in one training"));
  const bool release = quarantine == Quarantine::kReleased;
  if (release && batch_ids.empty())
    return refused("to release a batch takes its id").of("batch").next("say which one is good");
  const auto stored = TRY(store_.batches(cell_name));
  if (stored.empty())
    return failure(ErrorCode::kNotFound, "cell {} has no batch to train from", cell_name)
        .of("batch");

  StoredJob job;
  job.cell = cell_name;
  job.batch_ids = batch_ids.empty() ? std::vector{stored.back().id} : batch_ids;
  job.asked = AskedTraining{level, bias};
  job.created_at = unix_now();
  if (batch_ids.empty()) {
    auto earlier = TRY(earlier_sessions(store_, job, cell->sessions, options_.max_poses));
    job.batch_ids.insert(job.batch_ids.begin(), earlier.begin(), earlier.end());
  }
  TRY(check_together(stored, job.batch_ids, release));

  const MutexLock lock(submit_mutex_);
  if (const auto before = queued_before(id); !before || *before)
    return before.map(the_job);  // meanwhile
  TRY(check_room(cell_name));
  const auto accepted = TRY(store_.add_job(job, release, id));
  enqueue(accepted, true);
  return accepted.id;
}

Status Trainer::check_together(const std::vector<StoredBatch>& stored,
                               const std::vector<std::string>& batch_ids, bool release) const {
  const std::set<std::string> wanted(batch_ids.begin(), batch_ids.end());
  if (wanted.size() != batch_ids.size())
    return refused("a batch is named twice").of("batch").next("each counts once in a training");
  std::int64_t poses = 0;
  for (const StoredBatch& batch : stored) {
    if (!wanted.contains(batch.id)) continue;
    if (batch.pruned)
      return refused("batch {} was pruned", batch.id).of("batch").with_text(batch.id);
    if (const Status free = check_released(batch); !free && !release) return free;
    poses += batch.poses;
  }
  if (poses <= options_.max_poses) return {};
  return failure(ErrorCode::kTooLarge, "the batches have {} poses together, limit {}", poses,
                 options_.max_poses)
      .of("poses")
      .beyond(poses, options_.max_poses);
}

Status Trainer::cancel(std::int64_t id, const ChangeId& by) {
  const auto made = TRY(store_.outcome_of(by));
  if (made) return {};
  const auto job = TRY(store_.job(id));
  const auto over = [id] {
    return failure(ErrorCode::kConflict, "job {} is over", id).of("job").with_value(id);
  };
  if (is_over(job)) return over();
  if (store_.is_shared()) return cancel_in_record(job, by);
  const auto asked_for = TRY(was_asked_for(job));
  const JobQueue::Cancelled found = queue_.cancel(id, by.who);
  if (found == JobQueue::Cancelled::kStopping) return {};
  if (found == JobQueue::Cancelled::kUnknown) return over();
  const JobOutcome outcome = cancelled_outcome(by.who);
  if (auto ended = store_.set_job_failed(id, outcome.why, outcome, by); !ended) {
    queue_.push_front({id, job.cell, asked_for});  // restores the state before the request
    return ended;
  }
  JobProgress progress = progress_of(job);
  progress.stage = JobStage::kFailed;
  progress.what = outcome.why;
  progress.outcome = outcome;
  book_.report(progress);
  return {};
}

Result<std::optional<std::int64_t>> Trainer::queued_before(const ChangeId& id) const {
  return store_.outcome_of(id).map([](const std::optional<ChangeOutcome>& made) {
    return made ? std::optional(made->job) : std::nullopt;
  });
}

Status Trainer::check_room(const std::string& cell) const {
  const std::size_t waiting = queue_.asked_for(cell);
  const int capacity = queue_capacity_;
  if (waiting < static_cast<std::size_t>(capacity)) return {};
  return failure(ErrorCode::kBusy, "{} jobs that were asked for wait for cell {}, limit {}",
                 waiting, cell, capacity)
      .of("queue")
      .beyond(waiting, capacity)
      .next("try again later");
}

void Trainer::enqueue(const StoredJob& job, bool asked_for) {
  book_.report(progress_of(job));  // before the push: the worker's reports come after it
  queue_.push({job.id, job.cell, asked_for});
}

Result<bool> Trainer::was_asked_for(const StoredJob& job) const {
  if (job.kind() != JobKind::kTrain || job.batch_ids.size() != 1) return true;
  return store_.came_with_batches({job.id}).map(
      [](const std::set<std::int64_t>& came) { return came.empty(); });
}

Result<StoredDiagnosis> Trainer::diagnosis(std::int64_t job) const {
  auto found = store_.diagnosis(job);
  if (!found || !found->findings.empty()) return found;
  const auto state = TRY(store_.job(job));
  if (state.state == JobState::kFailed) return refused("job {} failed: {}", job, state.message);
  return failure(ErrorCode::kBusy, "job {} is not done yet", job)
      .of("job")
      .with_value(job)
      .next("try again later");
}

}  // namespace trammel
