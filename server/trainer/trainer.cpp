#include "server/trainer/trainer.h"

#include <pthread.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <set>
#include <utility>

#include "server/base/check.h"
#include "server/base/hash.h"
#include "server/base/name_check.h"
#include "server/base/units.h"
#include "server/base/unix_time.h"
#include "server/bias/kernels/kernel_spelling.h"
#include "server/compensate/model_file.h"
#include "server/error_sources/spelling.h"
#include "server/tasks/accept/judging.h"
#include "server/tasks/accept/verdict.h"
#include "server/trainer/compute/job_batches.h"
#include "server/trainer/job_sources.h"

namespace trammel {
namespace {

constexpr std::size_t kMaxSources = 500;  // as in a cell file
constexpr int kJobsListed = 20;           // of those done and of those failed, the last ones
constexpr std::chrono::seconds kLoadingAtStart{
    1};  // of models, before the service says that it is ready
constexpr std::chrono::seconds kKeeperTick{1};
constexpr int kKeeperNiceness = 5;  // answering comes before loading

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
      TRY(make_error_source(spec, cell));
    }
  }
  return bias.empty() ? Status() : check_bias_spelling(bias);
}

}  // namespace

Trainer::Trainer(const ServedCells& cells, Store& store, ModelRegistry& registry,
                 TrainerOptions options)
    : cells_(cells),
      store_(store),
      registry_(registry),
      options_(options),
      queue_capacity_(options.queue_capacity),
      keep_(options.keep),
      history_(cells_, store, registry),
      runner_(cells_, store, registry, history_, book_, options),
      began_at_(unix_now()) {}

Trainer::~Trainer() { stop(); }

void Trainer::set_listeners(ProgressListener progress, ModelListener model,
                            TroubleListener trouble) {
  TRAMMEL_CHECK(!worker_.joinable());
  book_.set_listener(std::move(progress));
  history_.set_listener(std::move(model));
  trouble_listener_ = std::move(trouble);
}

Result<std::vector<std::string>> Trainer::take_up() {
  TRAMMEL_CHECK(!worker_.joinable() && !taken_up_);
  std::vector<std::string> notices = history_.announce_all();
  if (store_.is_shared()) {
    presence_.describe(cells());
    is_present_ =
        store_.tell_presence(self()).has_value();  // the others know of it before it compares
    if (const auto now = store_.counts()) agree(now->descriptions);
  }
  const auto until = std::chrono::steady_clock::now() + kLoadingAtStart;
  const ServedCells& served = cells();
  for (auto cell = served.begin(); cell != served.end() && std::chrono::steady_clock::now() < until;
       ++cell)
    static_cast<void>(registry_.in_force(cell->first));  // what fails is among the troubles
  for (const std::string& trouble : troubles()) notices.push_back(trouble);
  queue_.hold(!options_.trains);
  auto unfinished = store_.unfinished_jobs();
  // The models are served all the same.
  if (!unfinished) notices.push_back("the jobs cannot be read: " + sentence(unfinished.error()));
  std::vector<StoredJob> jobs;
  for (StoredJob& job : unfinished.value_or(std::vector<StoredJob>())) {
    if (book_.find(job.id)) continue;  // accepted before the start, it waits already
    const auto wanted = can_take_up(job, notices);
    if (!wanted) {
      notices.push_back(sentence(wanted.error()));
      continue;
    }
    if (!*wanted) continue;
    queue_.push({job.id, job.cell, was_asked_for(job).value_or(true)});
    job.state = JobState::kQueued;
    jobs.push_back(std::move(job));
  }
  taken_up_ = std::move(jobs);
  return notices;
}

Result<bool> Trainer::can_take_up(const StoredJob& job, std::vector<std::string>& notices) {
  if (!cells().contains(job.cell)) {
    notices.push_back(fmt::format("job {} waits: cell {} is not served here", job.id, job.cell));
    return false;
  }
  if (!cells_.find(job.cell)) return false;  // it is set apart: that is said already
  if (job.state != JobState::kRunning || job.attempts < kMaxAttempts) return true;
  if (store_.is_shared() && !store_.set_job_running(job.id))
    return false;  // another server works on it
  const std::string why =
      fmt::format("its training was interrupted by a crash {} times", job.attempts);
  const JobOutcome outcome =
      failed_outcome(failure(ErrorCode::kInternal, "{}", why).value(), JobVerdict::kBroken);
  TRY(store_.set_job_failed(job.id, why, outcome));
  notices.push_back(fmt::format("job {} of cell {} has failed: {}", job.id, job.cell, why));
  return false;
}

Result<std::vector<std::string>> Trainer::start() {
  TRAMMEL_CHECK(!worker_.joinable());
  std::vector<std::string> notices;
  if (!taken_up_) {
    auto taken = take_up();
    if (!taken) return taken;
    notices = std::move(*taken);
  }
  for (const StoredJob& job : *taken_up_) book_.report(progress_of(job));
  taken_up_.reset();
  worker_ = std::jthread([this](const std::stop_token& stop) {
    ::pthread_setname_np(::pthread_self(), "trainer");
    while (const auto taken = queue_.take(stop)) {
      const JobRunner::End end = runner_.run(taken->job.id, {stop, taken->cancelled},
                                             [this] { return queue_.cancelled_by(); });
      if (end == JobRunner::End::kAgain) queue_.push(taken->job);
      if (end == JobRunner::End::kOver) prune(taken->job.cell, stop);
      // Another one works for the cell. What else waits of it is looked for when that is over.
      if (end == JobRunner::End::kElsewhere) queue_.remove_cell(taken->job.cell);
      queue_.put_down();
      // Asked for while its attempt ended: it waits again, and nobody told it.
      if (end == JobRunner::End::kAgain && taken->cancelled.stop_requested())
        static_cast<void>(cancel(taken->job.id, {"", "", queue_.cancelled_by()}));
    }
  });
  if (store_.is_shared()) {
    // What was taken up before is looked at once more: it may have changed meanwhile.
    follower_ = std::jthread([this](const std::stop_token& stop) { follow(0, stop); });
    heartbeat_ = std::jthread([this](const std::stop_token& stop) { beat(stop); });
  }
  keeper_ =
      std::jthread([this, told = troubles()](const std::stop_token& stop) { keep_up(told, stop); });
  reclaimer_ = std::jthread([this](const std::stop_token& stop) {
    ::pthread_setname_np(::pthread_self(), "reclaimer");
    registry_.free_models(stop);
  });
  return notices;
}

void Trainer::set_limits(int queue_capacity, const KeepRule& keep) {
  queue_capacity_ = queue_capacity;
  const MutexLock lock(keep_mutex_);
  keep_ = keep;
}

void Trainer::prune(const std::string& cell, const std::stop_token& stop) {
  KeepRule keep;
  {
    const MutexLock lock(keep_mutex_);
    keep = keep_;
  }
  // What the store refuses now is pruned after the next job.
  while (!stop.stop_requested() && store_.prune_one(cell, keep).value_or(false)) {
  }
}

void Trainer::keep_up(std::vector<std::string> told, const std::stop_token& stop) {
  ::pthread_setname_np(::pthread_self(), "keeper");
  ::setpriority(PRIO_PROCESS, static_cast<id_t>(::gettid()),
                kKeeperNiceness);  // of this thread alone
  while (!stop.stop_requested()) {
    registry_.load_for(stop, kKeeperTick);
    const bool was_readable = store_.state().readable;
    static_cast<void>(store_.try_again());  // what comes of it is the store's state
    if (!was_readable && store_.state().readable) take_up_late();
    tell_troubles(told);
  }
  registry_.stop_loading();
}

std::vector<std::string> Trainer::add_cells(const ServedCells& more) {
  const MutexLock lock(submit_mutex_);
  const ServedCells& before = cells();
  // Looked at before they are served: none of these jobs can end meanwhile.
  std::vector<StoredJob> jobs = store_.unfinished_jobs().value_or(std::vector<StoredJob>());
  std::erase_if(jobs, [&](const StoredJob& job) {
    return before.contains(job.cell) || !more.contains(job.cell);
  });
  cells_.add(more);
  if (store_.is_shared()) {
    presence_.describe(more);
    {
      const MutexLock look_again(agree_mutex_);
      descriptions_ = -1;
    }
    if (const auto now = store_.counts()) agree(now->descriptions);
  }
  std::vector<std::string> notices;
  for (const auto& [name, cell] : more) {
    if (before.contains(name)) continue;
    if (auto announced = history_.announce_from_store(name); !announced)
      notices.push_back(sentence(announced.error()));
  }
  take_up_jobs(std::move(jobs), notices);
  return notices;
}

void Trainer::take_up_late() {
  for (const auto& [name, cell] : cells()) {
    const std::vector<int> versions = store_.versions_to_serve(name);
    if (!versions.empty() && versions.front() != registry_.version_in_force(name))
      registry_.announce(name, versions.front());
  }
  const MutexLock lock(submit_mutex_);
  std::vector<std::string> notices;  // the next start says them again
  take_up_jobs(store_.unfinished_jobs().value_or(std::vector<StoredJob>()), notices);
}

void Trainer::take_up_jobs(std::vector<StoredJob> jobs, std::vector<std::string>& notices) {
  for (StoredJob& job : jobs) {
    if (book_.find(job.id) || !can_take_up(job, notices).value_or(false)) continue;
    job.state = JobState::kQueued;
    enqueue(job, was_asked_for(job).value_or(true));
  }
}

void Trainer::tell_troubles(std::vector<std::string>& told) {
  std::vector<std::string> now = troubles();
  if (now == told) return;
  const auto missing = [](const std::vector<std::string>& among, const std::string& one) {
    return std::find(among.begin(), among.end(), one) == among.end();
  };
  for (const std::string& trouble : now) {
    if (trouble_listener_ && missing(told, trouble)) trouble_listener_(trouble, false);
  }
  for (const std::string& trouble : told) {
    if (trouble_listener_ && missing(now, trouble)) trouble_listener_(trouble, true);
  }
  told = std::move(now);
}

std::vector<std::string> Trainer::troubles() const {
  std::vector<std::string> all;
  StoreState state = store_.state();
  if (state.why_not_written)
    all.push_back("the store cannot be written: " + sentence(*state.why_not_written));
  if (!state.clock.empty()) all.push_back(state.clock);
  for (std::string& damage : state.damages) all.push_back(std::move(damage));
  for (const auto& [cell, one] : cells_.apart()) all.push_back(one.why);
  for (std::string& trouble : history_.troubles()) {
    if (std::find(all.begin(), all.end(), trouble) == all.end()) all.push_back(std::move(trouble));
  }
  return all;
}

void Trainer::stop() {
  if (!worker_.joinable()) return;
  for (std::jthread* thread : {&worker_, &keeper_, &follower_}) thread->request_stop();
  for (std::jthread* thread : {&worker_, &keeper_, &follower_}) {
    if (thread->joinable()) thread->join();
  }
  if (heartbeat_.joinable()) {
    heartbeat_.request_stop();
    heartbeat_.join();
    static_cast<void>(store_.take_leave());  // a record that is away finds out by the clock
  }
  reclaimer_.request_stop();
  reclaimer_.join();
}

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
  const auto received =
      TRY(received_batch({batch.id, batch.csv, batch.accepted_at}, *cell,
                         held_out_by_service(options_.validation_share, options_.seed),
                         options_.compute.reads));
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
  job.kind = JobKind::kDiagnose;
  job.cell = cell_name;
  return look_at(std::move(job), batch_id, csv, apply, id);
}

Result<std::int64_t> Trainer::check(const std::string& cell_name, const std::string& batch_id,
                                    const std::string& csv, std::optional<double> tolerance_mm,
                                    const ChangeId& id) {
  if (cells_.find(cell_name) && !registry_.in_force(cell_name))
    return failure(ErrorCode::kNotFound, "cell {} has no model in force to hold a check against",
                   cell_name)
        .of("cell");
  StoredJob job;
  job.kind = JobKind::kCheck;
  job.cell = cell_name;
  if (tolerance_mm) job.level = fmt::format("{}", *tolerance_mm);
  return look_at(std::move(job), batch_id, csv, false, id);
}

Result<std::int64_t> Trainer::look_at(StoredJob job, const std::string& batch_id,
                                      const std::string& csv, bool apply, const ChangeId& id) {
  const std::string& cell_name = job.cell;
  if (const auto before = queued_before(id); !before || *before) return before.map(the_job);
  const auto cell = TRY(cells_.find(cell_name));
  if (!batch_id.empty() && !csv.empty()) {
    return failure(ErrorCode::kUsage,
                   "a {} is of a stored batch or of one that is sent, not of both",
                   job.kind == JobKind::kCheck ? "check" : "diagnosis");
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
  const auto accepted = TRY(store_.add_diagnosis(job, {csv, apply, "", ""}, id));
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
  job.level = level;
  job.bias = bias;
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
    queue_.push_front({id, job.cell, asked_for});  // as if it had not been asked
    return ended;
  }
  JobProgress progress = progress_of(job);
  progress.stage = JobStage::kFailed;
  progress.what = outcome.why;
  progress.outcome = outcome;
  book_.report(progress);
  return {};
}

Status Trainer::activate(const std::string& cell, int version, const ChangeId& id, bool force) {
  const auto made = TRY(store_.outcome_of(id));
  if (made) return {};
  const auto as_judged = [&](const ChangeId& decided) -> Status {
    TRY(store_.check_expected(cell, decided));
    const auto judged = judged_beside_present(cell, version);
    if (!judged && !force) return tl::make_unexpected(judged.error());
    const std::optional<GateVerdict> verdict = judged ? *judged : std::nullopt;
    const Status wanted = verdict && !force ? check_not_worse(cell, version, *verdict) : Status();
    return wanted ? history_.activate(cell, version, decided, verdict) : wanted;
  };
  if (!store_.is_shared()) return as_judged(id);
  // It is judged beside what the record has in force, and again where somebody changed that
  // meanwhile.
  constexpr int kMostAttempts = 8;
  for (int attempt = 1;; ++attempt) {
    static_cast<void>(history_.follow(cell));
    const auto recorded = TRY(store_.version_in_force(cell));
    ChangeId decided = id;
    if (!decided.expected_version) decided.expected_version = recorded.value_or(0);
    const Status done = as_judged(decided);
    const bool changed_meanwhile =
        !done && !id.expected_version && done.error().code == ErrorCode::kConflict;
    if (!changed_meanwhile || attempt == kMostAttempts) return done;
  }
}

Result<std::optional<GateVerdict>> Trainer::judged_beside_present(const std::string& cell_name,
                                                                  int version) const {
  const std::optional<GateVerdict> nothing_to_judge;
  const auto cell = TRY(cells_.find(cell_name));
  const auto present = registry_.in_force(cell_name);
  if (!present || present->version == version) return nothing_to_judge;
  const auto asked = TRY(registry_.version(cell_name, version));
  const auto own = TRY(store_.batches_of_version(cell_name, version));
  const auto sources = TRY(judging_sources(store_, cell_name, own));
  if (sources.empty()) return nothing_to_judge;  // a person decides, and has
  JobBatches batches(*cell, held_out_by_service(options_.validation_share, options_.seed),
                     options_.compute.reads, {});
  for (const BatchSource& source : sources) {
    const auto stored = TRY(store_.batch(cell_name, source.id));
    batches.add({source.id, stored.csv, stored.accepted_at}, true);
  }
  GateVerdict verdict = verdict_on(asked->model, present.get(), {}, {}, batches.judging_sessions(),
                                   {Bar::kBetter, options_.accept_ratio});
  verdict.why += fmt::format(" (judged by what {} batches hold out, the newest is {})",
                             sources.size(), sources.back().id);
  return std::optional(std::move(verdict));
}

Status Trainer::check_not_worse(const std::string& cell, int version,
                                const GateVerdict& verdict) const {
  const GateFigures& figures = verdict.figures;
  const bool has_figures = figures.before && figures.after;
  if (verdict.put_in_force ||
      (has_figures && *figures.after <= options_.accept_ratio * *figures.before))
    return {};
  const auto made_here = TRY(store_.was_made_by_job(cell, version));
  // The job that made it has said already that it could not be judged: whoever asks for it knows.
  // What few judges find worse by far is so all the same.
  const bool far_worse = has_figures && is_far_worse(*figures.before, *figures.after);
  if (made_here && !far_worse && (verdict.undecided || !has_figures)) return {};
  const char* how = has_figures ? "worse than" : "not known to be as good as";
  Failure worse =
      refused("cell {}: version {} is {} version {}, which is in force: {}", cell, version, how,
              registry_.version_in_force(cell), verdict.why)
          .of(has_figures ? "after_mm" : "version")
          .next(fmt::format(
              "trammel activate --service --model {}@{} --force puts it in force all the same",
              cell, version));
  if (!has_figures) return std::move(worse).with_value(version);
  const double limit = options_.accept_ratio * *figures.before;
  return std::move(worse).beyond(to_mm(*figures.after), to_mm(limit));
}

Status Trainer::release(const std::string& cell_name, const std::string& batch_id,
                        const ChangeId& id) {
  TRY(cells_.find(cell_name));
  return store_.set_quarantine(cell_name, batch_id, "", id);
}

Status Trainer::discard(const std::string& cell_name, const std::string& batch_id,
                        const ChangeId& id) {
  TRY(cells_.find(cell_name));
  return store_.discard(cell_name, batch_id, id);
}

Result<std::vector<StoredBatch>> Trainer::batches(const std::string& cell_name) const {
  std::vector<StoredBatch> all;
  for (const auto& [name, known] : cells()) {
    if (!cell_name.empty() && name != cell_name) continue;
    auto batches = store_.batches(name);
    if (!batches) return batches;
    std::move(batches->begin(), batches->end(), std::back_inserter(all));
  }
  return all;
}

Result<std::vector<StoredBatch>> Trainer::quarantined(const std::string& cell_name) const {
  return batches(cell_name).map([](std::vector<StoredBatch> all) {
    std::erase_if(
        all, [](const StoredBatch& batch) { return batch.quarantine.empty() || batch.discarded; });
    return all;
  });
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

Result<JobProgress> Trainer::progress(std::int64_t job) const {
  if (auto running = book_.find(job)) return *running;
  const auto stored = TRY(store_.job(job));
  return stored_progress(stored);
}

JobProgress Trainer::stored_progress(const StoredJob& job) const {
  JobProgress progress = progress_of(job);
  const auto present = registry_.in_force(job.cell);
  progress.in_force = present && job.model_version != 0 && present->version == job.model_version;
  return progress;
}

Result<std::vector<Trainer::DatedJob>> Trainer::jobs(const std::string& cell_name) const {
  const auto stored = TRY(store_.recent_jobs(cell_name, kJobsListed));
  std::vector<DatedJob> jobs;
  for (const StoredJob& job : stored) {
    auto now = TRY(progress(job.id));
    jobs.push_back({job, std::move(now)});
  }
  return jobs;
}

int Trainer::queued_jobs() const { return static_cast<int>(queue_.size()); }

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
  if (job.kind != JobKind::kTrain || job.batch_ids.size() != 1) return true;
  return store_.came_with_batches({job.id}).map(
      [](const std::set<std::int64_t>& came) { return came.empty(); });
}

}  // namespace trammel
