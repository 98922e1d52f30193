#include "server/trainer/job_runner.h"

#include <algorithm>
#include <chrono>
#include <exception>
#include <utility>

#include "server/base/unix_time.h"
#include "server/compensate/model_file.h"
#include "server/report/health_json.h"
#include "server/robot/cell_rules.h"
#include "server/tasks/train/given_up.h"
#include "server/trainer/job_sources.h"

namespace trammel {

namespace {

constexpr int kMostEarlierJobs = 500;  // among which earlier checks are looked for
constexpr std::chrono::milliseconds kReportInterval{50};  // of a running job, for its watchers
constexpr std::chrono::milliseconds kFirstPause{
    250};  // before the disk is asked again; twice as long each time
constexpr std::chrono::milliseconds kLongestPause{5000};

JobProgress progress_at(const StoredJob& job, JobStage stage) {
  JobProgress progress = progress_of(job);
  progress.stage = stage;
  return progress;
}

JobVerdict verdict_of(const Error& error) {
  const bool of_the_data = error.code != ErrorCode::kInternal && error.code != ErrorCode::kBusy;
  return of_the_data ? JobVerdict::kRefused : JobVerdict::kBroken;
}

void add_cost(JobOutcome& outcome, const ComputeCost& cost) {
  outcome.peak_memory = cost.peak_memory;
  outcome.processor_time = cost.processor_time;
}

/// One token for both reasons to stop.
class EitherStop {
 public:
  explicit EitherStop(const StopRequests& stop)
      : service_(stop.service, Call{&source_}), job_(stop.job, Call{&source_}) {}
  [[nodiscard]] std::stop_token token() const { return source_.get_token(); }

 private:
  struct Call {
    std::stop_source* source;
    void operator()() const { source->request_stop(); }
  };
  std::stop_source source_;
  const std::stop_callback<Call> service_, job_;
};

/// False: `stop` was requested first.
bool pause(std::chrono::milliseconds length, const std::stop_token& stop) {
  Mutex mutex;  // local: used only to wait
  Condition never;
  MutexLock lock(mutex);
  never.wait_for(lock, stop, length, [] { return false; });
  return !stop.stop_requested();
}

/// The drift of the cell's arm that its finished checks saw, oldest first.
Result<std::vector<DriftSeen>> earlier_checks(const Store& store, const std::string& cell) {
  const auto jobs = TRY(store.recent_jobs(cell, kMostEarlierJobs));
  std::vector<DriftSeen> earlier;
  for (const StoredJob& job : jobs) {
    if (job.kind() != JobKind::kCheck || job.state != JobState::kDone) continue;
    const auto found = store.diagnosis(job.id);
    auto drift = found ? drift_of(found->findings) : std::nullopt;
    if (drift) earlier.push_back(std::move(*drift));
  }
  return earlier;
}

bool is_same(const Opponents& a, const Opponents& b) {
  const auto versions = [](const Opponents& opponents) {
    std::vector<int> all = {opponents.in_force ? opponents.in_force->version : 0,
                            opponents.record ? opponents.record->version : 0};
    for (const ModelText& before : opponents.served_before) all.push_back(before.version);
    return all;
  };
  return versions(a) == versions(b);
}

}  // namespace

JobRunner::JobRunner(const CellBook& cells, Store& store, const ModelRegistry& registry,
                     ModelHistory& history, ProgressBook& book, const TrainerOptions& options)
    : cells_(cells),
      store_(store),
      registry_(registry),
      history_(history),
      book_(book),
      options_(options) {}

JobRunner::End JobRunner::run(std::int64_t id, const StopRequests& stop,
                              const CancelledBy& cancelled_by) {
  const Attempt attempted = [&]() -> Attempt {
    try {
      return attempt(id, stop);
    } catch (const std::exception&
                 error) {  // out of memory, for one: this job ends, the service goes on
      Failure broken = failure(ErrorCode::kInternal, "the training broke off: {}", error.what());
      return tl::make_unexpected(Failed{broken.value(), JobVerdict::kBroken});
    }
  }();
  const End how = attempted ? End::kOver : end(id, attempted.error(), stop, cancelled_by);
  claimed_ = 0;
  return how;
}

JobRunner::Attempt JobRunner::attempt(std::int64_t id, const StopRequests& stop) {
  const auto failed = [](const Error& error) {
    return tl::make_unexpected(Failed{error, verdict_of(error)});
  };
  const auto job = store_.job(id);
  if (!job) return failed(job.error());
  if (const auto cell = cells_.find(job->cell); !cell) {
    // Other servers answer for it
    const bool elsewhere = cell.error().code == ErrorCode::kConflict;
    return tl::make_unexpected(
        Failed{cell.error(), verdict_of(cell.error()), false, {}, elsewhere});
  }
  const Status running = once_the_disk_lets(id, stop, [&] { return store_.set_job_running(id); });
  if (!running) {
    const bool elsewhere = running.error().code == ErrorCode::kConflict;
    return tl::make_unexpected(
        Failed{running.error(), verdict_of(running.error()), false, {}, elsewhere});
  }
  lost_ = 0;
  claimed_ = id;
  // The cell may have been set apart while the claim was made: nobody saw a job to end.
  if (const auto cell = cells_.find(job->cell); !cell)
    return tl::make_unexpected(Failed{cell.error(), verdict_of(cell.error()), false, {}, true});
  book_.report(progress_at(*job, JobStage::kTraining));
  return compute(*job, stop);
}

JobRunner::Attempt JobRunner::compute(const StoredJob& job, const StopRequests& stop) {
  auto task = task_of(job);
  if (!task) return tl::make_unexpected(Failed{task.error(), verdict_of(task.error())});
  const std::vector<std::string> earlier = task->earlier_ids;
  const auto computing = start_computing(options_.compute, std::move(*task), stop);
  if (!computing) return tl::make_unexpected(Failed{computing.error(), JobVerdict::kBroken, true});
  if (const Status given = give_batches(**computing, job, earlier); !given)
    return tl::make_unexpected(failed_by(**computing, given.error()));
  ComputeWatch watch;
  watch.progress = reporter(job, stop);
  watch.found = [&](const std::string& findings, const std::string& page) {
    return once_the_disk_lets(job.id, stop,
                              [&] { return store_.store_findings(job.id, findings, page); });
  };
  const auto made = (*computing)->make(watch);
  if (!made) return tl::make_unexpected(failed_by(**computing, made.error()));
  if (!made->quarantine.empty())
    return quarantine(job, made->quarantine, (*computing)->cost(), stop);
  if (!made->model) return finish(job, *made, (*computing)->cost(), stop);
  return keep(job, *made, **computing, stop);
}

Result<ComputeTask> JobRunner::task_of(const StoredJob& job) const {
  ComputeTask task;
  task.cell = cells_.now().at(job.cell);
  task.asked = job.asked;
  task.batch_ids = job.batch_ids;
  const auto came = TRY(came_with_batch(job));
  task.hold_against_in_force = came;
  const auto alone = TRY(learns_alone(job, came));
  if (!alone) {
    auto earlier = TRY(earlier_sessions(store_, job, task.cell->sessions, options_.max_poses));
    task.earlier_ids = std::move(earlier);
  }
  if (const auto present = registry_.in_force(job.cell))
    task.in_force = ModelText{present->version, serialize(present->model)};
  task.fleet = fleet_prior_of(job);
  if (job.kind() == JobKind::kCheck) {
    auto earlier = TRY(earlier_checks(store_, job.cell));
    task.earlier_checks = std::move(earlier);
  }
  task.seed = options_.seed;
  task.validation_share = options_.validation_share;
  task.accept_ratio = options_.accept_ratio;
  task.now = unix_now();
  return task;
}

Result<bool> JobRunner::learns_alone(const StoredJob& job, bool came_with_batch) const {
  if (job.kind() != JobKind::kTrain) return true;
  if (came_with_batch) return false;
  // The job was requested: for batches that the requester released, with all knowledge of the cell;
  // otherwise for the batches that the requester named.
  const auto releases = store_.may_release(job.id);
  if (!releases) return releases;
  return !*releases;
}

/// The prior from the models in force of other cells with robots of the type. Empty if the cell
/// does not want it, or if there are too few.
std::optional<FleetPrior> JobRunner::fleet_prior_of(const StoredJob& job) const {
  const Cell& cell = *cells_.now().at(job.cell);
  const auto rules = rules_of(cell);
  if (job.kind() != JobKind::kTrain || !rules || !rules->fleet_prior) return std::nullopt;
  std::vector<FleetMember> twins;
  for (const auto& [name, other] : cells_.now()) {
    if (name == job.cell || !same_type(other->robot, cell.robot)) continue;
    if (const auto served = registry_.in_force(name)) twins.push_back({name, served->model});
  }
  auto prior = learn_fleet_prior(cell.robot, twins);
  return prior ? std::optional(std::move(*prior)) : std::nullopt;
}

Result<bool> JobRunner::came_with_batch(const StoredJob& job) const {
  if (job.kind() != JobKind::kTrain || job.batch_ids.size() != 1) return false;
  return store_.came_with_batches({job.id}).map(
      [](const std::set<std::int64_t>& came) { return !came.empty(); });
}

Status JobRunner::give_batches(Computing& computing, const StoredJob& job,
                               const std::vector<std::string>& earlier) const {
  const auto sources = TRY(batch_sources(store_, job, is_to_train(job.asked), earlier));
  for (const BatchSource& source : sources) {
    const auto stored = TRY(store_.batch(job.cell, source.id));
    TRY(computing.take({source.id, stored.csv, stored.accepted_at}, source.judges));
  }
  if (!job.batch_ids.empty()) return {};
  const auto sent = TRY(store_.diagnosis(job.id));
  return computing.take({"", sent.csv, job.created_at}, false);
}

JobRunner::Attempt JobRunner::keep(const StoredJob& job, const Made& made, Computing& computing,
                                   const StopRequests& stop) {
  JobProgress progress = progress_at(job, JobStage::kStoring);
  progress.share = 1;
  book_.report(progress);
  const ComputeCost cost = computing.cost();
  const Candidate candidate{
      *made.model, job, made.remarks, made.model_text, cost.peak_memory, cost.processor_time};
  std::optional<std::pair<Opponents, GateVerdict>>
      judged;  // the last time: the disk may make it be asked again
  const Judging judging = [&](const Opponents& opponents) -> Result<GateVerdict> {
    if (stop.any()) return given_up();
    if (judged && is_same(judged->first, opponents)) return judged->second;
    progress.what = kJudging;
    book_.report(progress);
    auto verdict = computing.judge(opponents);
    if (verdict) judged = {opponents, *verdict};
    return verdict;
  };
  const auto kept = once_the_disk_lets(
      job.id, stop, [&] { return history_.keep(candidate, judging, stop.service); });
  if (!kept) return tl::make_unexpected(failed_by(computing, kept.error()));
  progress.stage = JobStage::kDone;
  progress.what = kept->message;
  progress.model_version = kept->version;
  progress.in_force = kept->in_force;
  progress.outcome = kept->outcome;
  book_.report(progress);
  return {};
}

JobRunner::Attempt JobRunner::quarantine(const StoredJob& job, const std::string& why,
                                         const ComputeCost& cost, const StopRequests& stop) {
  const std::string& id = job.batch_ids.front();
  const Status kept = once_the_disk_lets(
      job.id, stop, [&] { return store_.set_quarantine(job.cell, id, why, {}, job.id); });
  if (!kept) return tl::make_unexpected(Failed{kept.error(), verdict_of(kept.error())});
  Failure refusal = refused("batch {} is in quarantine: {}; nothing was learned from it", id, why)
                        .of("batch")
                        .with_text(id)
                        .next("retrain --release if it is good");
  return tl::make_unexpected(Failed{refusal.value(), JobVerdict::kQuarantined, false, cost});
}

JobRunner::Attempt JobRunner::finish(const StoredJob& job, const Made& made,
                                     const ComputeCost& cost, const StopRequests& stop) {
  JobProgress progress = progress_at(job, JobStage::kDone);
  progress.share = 1;
  progress.what = made.message;
  progress.outcome = made.outcome;
  add_cost(progress.outcome, cost);
  const Status done = once_the_disk_lets(
      job.id, stop, [&] { return store_.set_job_done(job.id, made.message, progress.outcome); });
  if (!done) return tl::make_unexpected(Failed{done.error(), verdict_of(done.error())});
  book_.report(progress);
  return {};
}

JobRunner::End JobRunner::end(std::int64_t id, const Failed& failed, const StopRequests& stop,
                              const CancelledBy& cancelled_by) {
  StoredJob job;
  job.id = id;
  if (const auto known = book_.find(id)) job.cell = known->cell;
  if (failed.elsewhere || lost_ == id) {
    // If this server may not work for the cell, it returns the job, so that others need not wait
    // for the end of its lease.
    if (claimed_ == id && !cells_.find(job.cell)) static_cast<void>(store_.set_job_queued(id));
    return End::kElsewhere;
  }
  if (auto stored = store_.job(id)) job = std::move(*stored);
  const bool cancelled = stop.job.stop_requested();
  if (stop.service.stop_requested() && !cancelled) return put_back(job, job.message, false, stop);
  const std::string why = sentence(failed.error);
  // A record that was away or locked for a moment does not end a job. If its result was stored
  // after all, the next attempt finds the job finished.
  if (store_.is_shared() && failed.error.code == ErrorCode::kBusy && !cancelled)
    return put_back(job, fmt::format("{}; it is tried again", why), false, stop);
  if (!cancelled && failed.again && job.attempts < kMaxAttempts)
    return put_back(
        job, fmt::format("{}; it is tried again ({} of {})", why, job.attempts + 1, kMaxAttempts),
        true, stop);
  JobProgress progress = progress_at(job, JobStage::kFailed);
  const std::string who = cancelled ? cancelled_by() : "";
  progress.outcome =
      cancelled ? cancelled_outcome(who) : failed_outcome(failed.error, failed.verdict);
  add_cost(progress.outcome, failed.cost);
  progress.what = cancelled ? progress.outcome.why : why;
  if (!cancelled && failed.again) progress.what += fmt::format("; tried {} times", job.attempts);
  const Status ended = once_the_disk_lets(id, {stop.service, {}}, [&] {
    return store_.set_job_failed(id, progress.what, progress.outcome, {"", "", who});
  });
  if (ended) {
    book_.report(progress);
  } else if (ended.error().code != ErrorCode::kNotFound) {  // otherwise its model is stored, or the
                                                            // job is another server's
    // The store still has the job as unfinished: the next start takes it up.
    progress.stage = JobStage::kQueued;
    progress.what += "; the store does not take that: " + sentence(ended.error());
    book_.report(progress);
  }
  return End::kOver;
}

JobRunner::End JobRunner::put_back(const StoredJob& job, const std::string& why,
                                   bool attempt_counts, const StopRequests& stop) {
  // If the store refuses, the job counts as interrupted and is taken up anyway.
  static_cast<void>(once_the_disk_lets(
      job.id, stop, [&] { return store_.set_job_queued(job.id, attempt_counts); }));
  JobProgress progress = progress_at(job, JobStage::kQueued);
  progress.what = why;
  const auto known = book_.find(job.id);
  // A lock that stays is met once a second, and told once.
  if (!known || known->stage != progress.stage || known->what != why) book_.report(progress);
  return End::kAgain;
}

JobRunner::Failed JobRunner::failed_by(const Computing& computing, const Error& error) const {
  Failed failed{error, verdict_of(error), false, computing.cost()};
  const auto breakdown = computing.breakdown();
  if (!breakdown) return failed;
  const bool over_limit = breakdown->kind == Breakdown::Kind::kOverMemory ||
                          breakdown->kind == Breakdown::Kind::kOverTime;
  failed.error = breakdown->error;
  failed.verdict = over_limit ? JobVerdict::kOverLimit : JobVerdict::kBroken;
  failed.again = !over_limit;
  return failed;
}

template <typename Work>
auto JobRunner::once_the_disk_lets(std::int64_t job, const StopRequests& stop, const Work& work)
    -> decltype(work()) {
  const EitherStop either(stop);
  for (auto length = kFirstPause;; length = std::min(2 * length, kLongestPause)) {
    auto worked = work();
    const bool of_the_disk =
        !worked && worked.error().code == ErrorCode::kBusy && store_.state().why_not_written;
    if (!of_the_disk || stop.any()) return worked;
    report_waiting(job, worked.error());
    if (!pause(length, either.token()) || !store_.wait_until_writable(either.token()))
      return worked;
  }
}

void JobRunner::report_waiting(std::int64_t job, const Error& why) {
  auto progress = book_.find(job);
  if (!progress) return;
  progress->what = "waits for the disk: " + sentence(why);
  book_.report(*progress);
}

std::function<bool(const std::string&, double)> JobRunner::reporter(const StoredJob& job,
                                                                    const StopRequests& stop) {
  auto reported = std::make_shared<std::chrono::steady_clock::time_point>();
  return [this, running = progress_at(job, JobStage::kTraining), reported, stop](
             const std::string& stage, double share) mutable {
    const auto time = std::chrono::steady_clock::now();
    if (time >= *reported + kReportInterval) {
      *reported = time;
      running.what = stage;
      running.share = share;
      book_.report(running);
    }
    return !stop.any();
  };
}

}  // namespace trammel
